"""The simulated rig with an effect that no model declares, drawn by class, number and seed.

A case's folder holds logs and nothing else, under a name that gives nothing away.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.case import KINDS, write_recordings
from benchmarks.diagnosis.excitation import RUNS, plans_of, wrist_motion
from benchmarks.diagnosis.truths import CATALOGUED, OUTSIDE, TRUTHS
from estimation.recording import FloatArray, Instrument, Recording
from rig.protocols import trajectory
from rig.protocols.motion import motion_of
from rig.protocols.protocol import RunPlan, load_protocol
from rig.simulation.bench import SimulatedBench
from rig.simulation.fitted import DECLARED_PLANT
from rig.simulation.hidden import NAMES, HiddenEffect
from rig.simulation.hidden_kinds import KINDS as HIDDEN
from rig.simulation.parameters import PlantParameters, SensorParameters, vary
from rig.simulation.plant import TICK_S
from rig.simulation.play import play
from rig.simulation.sensors import spindle_count_of

WEAK = 0.3
"""Strength of a weak case for one of a strong one."""

CHAINS = ("plain", "coloured", "drifting", "skewed")
"""Faults of a logger in a case, in addition to white noise and counts."""

CLEAN = (*((chain, "usual") for chain in CHAINS), ("coloured", "rests"), ("coloured", "wrist"))
"""Chain and excitation of clean cases, in turn."""

EITHER = {
    "one spring": ("friction.load", "motor.saturation"),
    "constant speed": ("friction.load", "motor.saturation", "friction.load_viscous"),
}
"""Families that such runs cannot distinguish from friction by load: with loads of one sign only the
rotor's own friction separates it from a falling torque constant, and at one speed nothing separates
it from what depends on speed."""

SPREAD = 0.1
EPOCH_NS = 1_700_000_000_000_000_000
APART_S = 30.0
"""From the start of one run to that of the next."""

FADE_S = 120.0
WRIST_COUNTS = 8192


@dataclass(frozen=True)
class Answer:
    """What is hidden in a case.

    Attributes:
        case: Name of its folder.
        kind: One of `KINDS`.
        effects: The hidden effects; none in a clean case.
        runs: Places of the runs that have them.
        excitation: One of `EXCITATIONS`.
        chain: One of `CHAINS`.
        either: For a confounded case: families that its runs cannot distinguish.
    """

    case: str
    kind: str
    effects: tuple[HiddenEffect, ...]
    runs: tuple[int, ...]
    excitation: str = "usual"
    chain: str = "plain"
    either: tuple[str, ...] = ()

    def in_run(self, index: int) -> tuple[HiddenEffect, ...]:
        """Return the effects of one run, as strong as they are there."""
        if index not in self.runs:
            return ()
        return tuple(
            replace(e, strength=e.strength / (1.0 + index * APART_S / FADE_S))
            if TRUTHS[e.name].course == "fades"
            else e
            for e in self.effects
        )


def draw(kind: str, number: int, seed: int) -> Answer:
    """Draw a case's answer; the same class, number and seed give the same case."""
    if kind not in KINDS:
        raise ValueError(f"Unknown class {kind!r}; there are {', '.join(KINDS)}.")
    word = hashlib.sha256(f"{kind}/{number}/{seed}".encode()).hexdigest()
    random = np.random.default_rng(int(word[:15], 16))
    chain, excitation = CHAINS[int(random.integers(len(CHAINS)))], "usual"
    if kind == "clean":
        chain, excitation = CLEAN[number % len(CLEAN)]
    either: tuple[str, ...] = ()
    if kind == "confounded":
        excitation = ("one spring", "constant speed")[number % 2]
        either = EITHER[excitation]
    names = _names(kind, number, seed, random)
    needed = {TRUTHS[name].needs for name in names} - {"usual"}
    excitation = needed.pop() if needed else excitation
    effects = tuple(_shaped(name, random, WEAK if kind == "weak" else 1.0) for name in names)
    runs = tuple(range(RUNS))
    if kind == "some_runs":
        count = int(random.integers(5, 9))
        runs = tuple(sorted(int(k) for k in random.choice(RUNS, count, replace=False)))
    elif any(TRUTHS[name].course == "comes" for name in names):
        runs = tuple(range(int(random.integers(5, 10)), RUNS))
    return Answer(f"case-{word[-10:]}", kind, effects, runs, excitation, chain, either)


def _names(kind: str, number: int, seed: int, random: np.random.Generator) -> list[str]:
    if kind in ("strong", "weak"):
        return [_cycled(sorted(CATALOGUED), number, seed)]
    lasting = sorted(name for name, truth in CATALOGUED.items() if not truth.course)
    if kind == "some_runs":
        return [_cycled(lasting, number, seed)]
    if kind == "outside":
        return [_cycled(sorted(OUTSIDE), number, seed)]
    if kind == "confounded":
        return ["gear_load_friction"]
    while kind == "pair":
        first, second = (str(name) for name in random.choice(lasting, 2, replace=False))
        one, other = CATALOGUED[first], CATALOGUED[second]
        if other.family not in (one.family, *one.accepted) and "usual" in (one.needs, other.needs):
            return [first, second]
    return []


def _cycled(names: list[str], number: int, seed: int) -> str:
    """Return a name such that each comes once before any comes twice."""
    order = np.random.default_rng([seed, number // len(names)]).permutation(len(names))
    return names[int(order[number % len(names)])]


def _shaped(name: str, random: np.random.Generator, share: float) -> HiddenEffect:
    kind = HIDDEN[NAMES.index(name)]
    shape = [float(random.uniform(part.low, part.high)) for part in kind.shapes]
    shape = [
        float(round(value)) if part.whole else value
        for value, part in zip(shape, kind.shapes, strict=True)
    ]
    strength = TRUTHS[name].scale * random.uniform(0.85, 1.15) * share
    return HiddenEffect(name, float(strength), tuple(shape))


def write(answer: Answer, folder: Path) -> None:
    """Write a case's recordings into an empty folder."""
    write_recordings(folder, record(answer, plans_of(answer.excitation)))


def write_next(answer: Answer, protocol: Path, folder: Path) -> None:
    """Play a protocol on the case's rig and write its runs next to the existing ones."""
    plans = [replace(p, name=f"next-{p.name}") for p in load_protocol(str(protocol)).plans()]
    later = range(RUNS, RUNS + len(plans))
    lasting = replace(answer, runs=(*answer.runs, *later))
    write_recordings(folder, record(lasting, plans, later))


def record(
    answer: Answer, plans: Sequence[RunPlan], places: Sequence[int] | None = None
) -> Iterator[Recording]:
    """Yield a case's recordings; nothing in them names what is hidden.

    Args:
        answer: From `draw`.
        plans: The runs.
        places: Place of each run in the campaign; from 0 on when None.
    """
    rig_seed = int(answer.case[-8:], 16)
    plant = vary(DECLARED_PLANT, rig_seed, SPREAD)
    sensors = _sensors(answer.chain, rig_seed)
    for index, plan in zip(range(len(plans)) if places is None else places, plans, strict=True):
        moved = replace(plant, **wrist_motion(answer.excitation, index))
        made = _record(plan, moved, sensors, answer.in_run(index), rig_seed * 1009 + index, index)
        if answer.excitation == "wrist":
            made = made.with_columns(wrist_pitch_rad=_wrist(plan, moved))
        yield _skewed(made, rig_seed * 1013 + index) if answer.chain == "skewed" else made


def _sensors(chain: str, rig_seed: int) -> SensorParameters:
    """Return the sensors of a rig with one of `CHAINS`."""
    sensors = vary(SensorParameters(), rig_seed, SPREAD)
    if chain == "drifting":
        return replace(
            sensors,
            proximal_ramp_n_m_s=5.0 * sensors.proximal_ramp_n_m_s,
            distal_ramp_n_m_s=5.0 * sensors.distal_ramp_n_m_s,
            torque_walk_n_m_s=3.0 * sensors.torque_walk_n_m_s,
        )
    if chain == "coloured":
        random = np.random.default_rng(rig_seed)
        return replace(
            sensors,
            torque_colour_n_m=0.3e-3,
            current_colour_a=1e-3,
            colour_time_s=float(random.uniform(0.02, 0.1)),
        )
    return sensors


def _wrist(plan: RunPlan, plant: PlantParameters) -> FloatArray:
    """Return the reading of the wrist's encoder during a run."""
    motion = motion_of(plan, float(plan.target_angle_rad[0]))
    phase = 2.0 * np.pi * TICK_S * np.arange(motion.first, motion.last)
    pitch = plant.wrist_middle_rad + plant.wrist_swing_rad * np.sin(phase / plant.wrist_period_s)
    step = 2.0 * np.pi / WRIST_COUNTS
    read: FloatArray = np.floor(pitch / step) * step
    return read


def _record(
    plan: RunPlan,
    plant: PlantParameters,
    sensors: SensorParameters,
    effects: tuple[HiddenEffect, ...],
    seed: int,
    index: int,
) -> Recording:
    start_rad = float(plan.target_angle_rad[0])
    count = spindle_count_of(start_rad, sensors)
    bench = SimulatedBench(plant, sensors, effects, seed, count)
    motion = motion_of(plan, start_rad)
    columns = play(bench, *(values[: motion.last] for values in motion.setpoints))
    return Recording(
        plan.name,
        np.arange(motion.last - motion.first) / trajectory.SAMPLE_RATE_HZ,
        {name: values[motion.first :] for name, values in columns.items()},
        conditions=plan.conditions,
        rig="simulated rig",
        instrument=Instrument(model="Maryland", serial="SIM-TOOL-1", side="left"),
        started_at_ns=EPOCH_NS + round(index * APART_S * 1e9),
        source="simulated",
    )


def _skewed(recording: Recording, seed: int) -> Recording:
    """Return the recording as a logger with a clock of its own would have dated it."""
    random = np.random.default_rng(seed)
    skew = 1.0 + 1e-4 * random.uniform(-1.0, 1.0)
    jitter_s = 2e-6 * random.uniform(-1.0, 1.0, len(recording))
    return replace(recording, time_s=recording.time_s * skew + jitter_s)
