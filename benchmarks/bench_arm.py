"""Regressor, identification and live wrench of an arm."""

import sys
import time

import numpy as np

from benchmarks.ratio import Ratio, best_of

SAMPLES = 5000
SYMBOLIC_SAMPLES = 500
IDENTIFICATION_S = 5.0
PATH_S = 30.0
CORE_SHARE = 0.05
LIVE_PERIOD_S = 1e-3
LIVE_SAMPLES = 500


def measure() -> list[Ratio]:
    """Time the three; an empty list without Pinocchio or SymPy."""
    try:
        import pinocchio  # noqa: F401
        import sympy  # noqa: F401
    except ImportError as error:
        sys.stderr.write(f"bench_arm skipped: {error}\n")
        return []
    return [_regressor(), _identification(), _live()]


def _regressor() -> Ratio:
    from benchmarks.symbolic_arm import compiled
    from estimation.arm.regressor import regressor
    from estimation.arm.tables import PSM
    from rig.arm.simulated import excitation

    motion = excitation(np.random.default_rng(0), SAMPLES / 100)
    symbolic = compiled(PSM)
    states = np.hstack([motion.position, motion.velocity, motion.acceleration])
    table = regressor(PSM, motion)
    links = np.array(symbolic(*states[7])).reshape(-1, len(PSM.joints)).T
    np.testing.assert_allclose(links, table[7, :, : links.shape[1]], atol=1e-9)
    few = states[:SYMBOLIC_SAMPLES].tolist()

    def by_sympy() -> None:
        for state in few:
            symbolic(*state)

    theirs = best_of(by_sympy) * SAMPLES / SYMBOLIC_SAMPLES
    ours = best_of(lambda: regressor(PSM, motion), 5)
    return Ratio(
        f"arm regressor of {SAMPLES} samples over SymPy's lambdify",
        theirs / ours,
        20.0,
        detail=f"rig {1e3 * ours:.0f} ms, SymPy {1e3 * theirs:.0f} ms; same columns",
    )


def _identification() -> Ratio:
    from estimation.recording import Recording
    from rig.arm.search import prepare
    from rig.arm.simulated import RATE_HZ, excitation

    rng = np.random.default_rng(1)
    motion = excitation(rng, PATH_S)
    position = np.hstack([motion.position, motion.position[:, [5]]])
    torque = np.cumsum(rng.normal(size=position.shape), axis=0)
    columns = {}
    for k in range(7):
        units = ("angle_rad", "velocity_rad_s", "torque_n_m")
        if k == 2:
            units = ("position_m", "velocity_m_s", "force_n")
        for unit, values in zip(units, (position, position, torque), strict=True):
            columns[f"joint_{k + 1}_{unit}"] = values[:, k]
    time_s = np.arange(len(position)) / RATE_HZ
    path = Recording(name="path", time_s=time_s, columns=columns)

    def identify() -> None:
        prepared = prepare(path)
        prepared.values([block.name for block in prepared.blocks[1:]])

    took = best_of(identify, 2)
    return Ratio(
        "time to identify an arm's path with every effect, s",
        took,
        IDENTIFICATION_S,
        higher_is_better=False,
        detail=f"{len(position)} samples",
    )


def _live() -> Ratio:
    from estimation.arm.regressor import names
    from estimation.arm.tables import PSM
    from estimation.arm.wrench import LiveWrench
    from rig.arm.simulated import excitation

    motion = excitation(np.random.default_rng(2), 20.0)
    values = 0.1 * np.random.default_rng(3).normal(size=len(names(PSM)))
    live = LiveWrench(PSM, values, np.full(6, 0.05), LIVE_PERIOD_S)
    for position in motion.position[:100]:
        live.step(position, position)

    def steps() -> None:
        for position in motion.position[:LIVE_SAMPLES]:
            live.step(position, position)

    step_s = best_of(steps, 20) / LIVE_SAMPLES
    start = time.process_time()
    steps()
    busy_s = (time.process_time() - start) / LIVE_SAMPLES
    return Ratio(
        "live wrench at 1 kHz, share of a core in %",
        100 * step_s / LIVE_PERIOD_S,
        100 * CORE_SHARE,
        higher_is_better=False,
        detail=f"{1e6 * step_s:.0f} us a step (processor time {1e6 * busy_s:.0f} us)",
    )
