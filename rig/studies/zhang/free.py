"""Torque in free space: Figure 3 and Tables I and II of Zhang et al. 2022 on one simulated arm."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from estimation.arm.identification import nrmsd_percent
from estimation.recording import FloatArray
from rig.arm.hidden import FAMILIES, OWN, draw_hidden
from rig.studies.zhang.networks import JointNetwork, trained, transferred
from rig.studies.zhang.physics import Physics, find_effects, fitted
from rig.studies.zhang.psm import (
    GRIPPER,
    KINDS,
    RATE_HZ,
    Psm,
    PsmRun,
    memory,
    simulate,
    with_instrument,
)
from rig.studies.zhang.psm_motion import LEAD_SAMPLES, moving_gripper, random_path, with_gripper

NETWORKS, BARE, OURS = "paper's networks", "physical model alone", "physical model and network"
SHORT = "paper's networks on our minutes"
FLOOR = "white noise of the torque alone"

MINUTES = 15.0
"""Of free motion a condition, split 5:1:1 into training, validation and test."""

OUR_MINUTES = 3.0
"""Of free motion that ours is fitted on, half with the gripper moving, half closed."""

OTHER_MINUTES = (3.0, 1.0, 1.0)
"""Of another instrument: training, validation, test."""

OUR_OTHER_MINUTES = 1.0
PARTS = 4
SETTLE = 100
"""Samples at the start of every test that are not scored, for any method."""

Cells = dict[str, tuple[float, ...]]
"""Errors by `experiment | condition | method`."""


@dataclass(frozen=True)
class Split:
    """Runs of one condition."""

    train: PsmRun
    validation: PsmRun
    test: PsmRun


def free_runs(psm: Psm, rng: np.random.Generator, moving: bool) -> Split:
    """Return the runs in free space of one condition: gripper moving, or closed."""
    seconds = [60 * MINUTES * share / 7 for share in (5, 1, 1)]
    return Split(*(_free(psm, rng, s, moving) for s in seconds))


def of_family(psm: Psm, family: str, seed: int) -> Psm:
    """Return an arm whose hidden torque is of a family, as large as its friction with memory."""
    if family == OWN:
        return psm
    rng = np.random.default_rng([seed, FAMILIES.index(family)])
    path, open_rad = random_path(rng, 60.0), psm.kind.open_rad
    motion = with_gripper(path, moving_gripper(rng, 60.0, open_rad), open_rad)
    form = draw_hidden(family, rng, motion, np.std(memory(psm, motion), axis=0))
    return replace(psm, form=form)


def _free(psm: Psm, rng: np.random.Generator, seconds: float, moving: bool) -> PsmRun:
    path, open_rad = random_path(rng, seconds), psm.kind.open_rad
    gripper = moving_gripper(rng, seconds, open_rad) if moving else 0.0
    return simulate(psm, with_gripper(path, gripper, open_rad), rng, lead=LEAD_SAMPLES)


def table_1(splits: dict[str, Split], seed: int) -> tuple[tuple[JointNetwork, ...], Cells]:
    """Return the networks trained on both conditions, and the errors of all in Table I, %."""
    closed, moving = splits["C"], splits["M"]
    samples = len(moving.train)
    both = [moving.train.part(0, 3 * samples // 5), closed.train.part(0, 2 * samples // 5)]
    trainings = {
        "C": ([closed.train], [closed.validation]),
        "M": ([moving.train], [moving.validation]),
        "M+C": (both, [moving.validation, closed.validation]),
    }
    cells: Cells = {}
    for name, (runs, validation) in trainings.items():
        networks = tuple(trained(k, runs, validation, name != "C", seed) for k in range(GRIPPER))
        cells |= _cells(splits, name, NETWORKS, partial(side_by_side, networks))
    return networks, cells


def side_by_side(networks: Sequence[JointNetwork], run: PsmRun) -> FloatArray:
    """Return the torque of a run in free space by a network a joint, shape (n, joints)."""
    return np.column_stack([network(run) for network in networks])


def _cells(
    splits: dict[str, Split], trained_on: str, method: str, free_of: Callable[[PsmRun], FloatArray]
) -> Cells:
    """Return a method's errors on the test of each condition, %."""
    return {
        f"I | {trained_on} on {test} | {method}": _nrmse(free_of(split.test), split.test)
        for test, split in splits.items()
    }


def fitted_physics(psm: Psm, splits: dict[str, Split]) -> tuple[Physics, Cells]:
    """Return ours, fitted on the first minutes of both conditions, and its errors, %."""
    half = round(OUR_MINUTES / 4 * 60 * RATE_HZ)
    first, second = (
        [splits[name].train.part(start, start + half) for name in ("M", "C")] for start in (0, half)
    )
    effects = find_effects(psm.table, first, second)
    physics = fitted(psm.table, effects, [splits[name].train.part(0, 2 * half) for name in "MC"])
    cells = {f"I | M+C on {name} | {FLOOR}": _noise(psm, s.test) for name, s in splits.items()}
    cells |= _cells(splits, "M+C", BARE, lambda run: physics(run, network=False)[:, :GRIPPER])
    cells |= _cells(splits, "M+C", OURS, lambda run: physics(run)[:, :GRIPPER])
    return physics, cells


def short_networks(splits: dict[str, Split], seed: int) -> Cells:
    """Return the errors of networks trained on the minutes that ours is fitted on, %.

    The last sixth of them chooses the step.
    """
    samples = round(OUR_MINUTES / 2 * 60 * RATE_HZ)
    cut = 5 * samples // 6
    runs = [splits[name].train.part(0, cut) for name in "MC"]
    validation = [splits[name].train.part(cut, samples) for name in "MC"]
    networks = [trained(k, runs, validation, True, seed) for k in range(GRIPPER)]
    return _cells(splits, "M+C", SHORT, partial(side_by_side, networks))


def _nrmse(free: FloatArray, run: PsmRun) -> tuple[float, ...]:
    """Return the mean over parts of the test of each joint's error over its range, %."""
    torque = run.torque[:, : free.shape[1]]
    errors = [nrmsd_percent(free[part], torque[part]) for part in _parts(run)]
    return tuple(map(float, np.mean(errors, axis=0)))


def _noise(psm: Psm, run: PsmRun) -> tuple[float, ...]:
    """Return the error that is left of each joint where all but the noise is known, %."""
    spreads = [np.ptp(run.torque[part, :GRIPPER], axis=0) for part in _parts(run)]
    return tuple(map(float, np.mean(100 * psm.noise[:GRIPPER] / spreads, axis=0)))


def _parts(run: PsmRun) -> list[NDArray[np.intp]]:
    return np.array_split(np.arange(SETTLE, len(run)), PARTS)


def figure_3(psm: Psm, rng: np.random.Generator) -> Cells:
    """Return how far each joint's torque goes from that with the gripper at rest at 0, RMS."""
    seconds, open_rad = 60.0, psm.kind.open_rad
    path = random_path(rng, seconds)
    cases: dict[str, tuple[FloatArray | float, float | None]] = {
        "0 degrees": (0.05, None),
        "moving": (moving_gripper(rng, seconds, open_rad), None),
        "40 degrees": (np.radians(40.0), None),
        "holding foam": (0.05, -0.06),
    }
    shown = {}
    for name, (gripper, torque) in cases.items():
        motion = with_gripper(path, gripper, open_rad)
        held = None if torque is None else np.full(len(motion), torque)
        run = simulate(psm, motion, rng, grip_n_m=held, lead=LEAD_SAMPLES)
        shown[name] = run.torque[:, :GRIPPER]
    still = shown.pop("0 degrees")
    return {
        f"Figure 3 | {name} | measured": tuple(
            map(float, np.sqrt(np.mean((torque - still) ** 2, axis=0)))
        )
        for name, torque in shown.items()
    }


def table_2(
    forceps: Psm, rng: np.random.Generator, seed: int, family: str
) -> tuple[JointNetwork, Cells]:
    """Return the forceps' gripper network after transfer, and the errors on each instrument."""

    def mounted(name: str) -> Psm:
        return of_family(with_instrument(rng, forceps.arm, name), family, seed)

    driver = mounted("LND")
    known = free_runs(driver, rng, moving=True)
    source = trained(GRIPPER, [known.train], [known.validation], True, seed)
    fit = round(OUR_MINUTES / 2 * 60 * RATE_HZ)
    effects = find_effects(
        driver.table, [known.train.part(0, fit)], [known.train.part(fit, 2 * fit)]
    )
    cells: Cells = {}
    for name in KINDS:
        if name == "LND":
            continue
        psm = forceps if name == "CF" else mounted(name)
        train, validation, test = (_free(psm, rng, 60 * m, True) for m in OTHER_MINUTES)
        adapted = transferred(source, [train], [validation])
        if name == "CF":
            gripper = adapted
        short = train.part(0, round(60 * OUR_OTHER_MINUTES * RATE_HZ))
        own = fitted(psm.table, effects, [short])
        estimates = {
            ("before", NETWORKS): source(test),
            ("after", NETWORKS): adapted(test),
            ("after", BARE): own(test, network=False)[:, GRIPPER],
            ("after", OURS): own(test)[:, GRIPPER],
        }
        kept = slice(SETTLE, None)
        for (when, method), free in estimates.items():
            error = nrmsd_percent(free[kept, None], test.torque[kept, GRIPPER:])
            cells[f"II {when} | {name} | {method}"] = (float(error[0]),)
    return gripper, cells
