"""Cases of the project's own simulator: the reference rig with an effect that no model declares.

They are drawn by class, number and seed, with the shipped protocols and the declared models. A
case's folder holds logs and nothing else, under a name that gives nothing away.
"""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.diagnosis import scoring
from benchmarks.diagnosis.case import KINDS, Case, in_turn, write_recordings
from benchmarks.diagnosis.truths import CATALOGUED, OUTSIDE, TRUTHS
from estimation.recording import FloatArray, Recording
from rig.protocols import trajectory
from rig.protocols.motion import motion_of
from rig.protocols.protocol import Protocol, RunPlan, load_protocol
from rig.simulation.campaign import bench_at, simulated_run
from rig.simulation.fitted import DECLARED_PLANT
from rig.simulation.hidden import KINDS as HIDDEN
from rig.simulation.hidden import NAMES, HiddenEffect
from rig.simulation.parameters import PlantParameters, SensorParameters, vary
from rig.simulation.plant import TICK_S

COUNTS = {
    "strong": 10,
    "weak": 6,
    "pair": 6,
    "outside": 5,
    "some_runs": 4,
    "confounded": 4,
    "clean": 5,
}

RUNS = 14
EXCITATIONS = ("usual", "one spring", "constant speed", "rests", "wrist")
"""`rests` adds rests of several lengths; in `wrist` the wrist swings while the jaw works."""

DWELLS = {
    "kind": "dwell",
    "travel_rad": 0.5,
    "move_s": 0.6,
    "dwells_s": [0.1, 0.4, 3.0, 0.2, 1.5, 0.6, 0.1, 2.0, 0.3],
    "jaw_starts_rad": [-0.95, -0.7],
    "loads_a": [0.15, 0.45, 0.8],
}

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
    shape = [part.drawn(random) for part in kind.shapes]
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
    """Yield a case's recordings at their places in the campaign; nothing names what is hidden."""
    rig_seed = int(answer.case[-8:], 16)
    plant = vary(DECLARED_PLANT, rig_seed, SPREAD)
    sensors = _sensors(answer.chain, rig_seed)
    for index, plan in zip(range(len(plans)) if places is None else places, plans, strict=True):
        moved = replace(plant, **wrist_motion(answer.excitation, index))
        start_rad = float(plan.target_angle_rad[0])
        effects, seed = answer.in_run(index), rig_seed * 1009 + index
        bench = bench_at(start_rad, moved, sensors, effects, seed)
        started_at_ns = EPOCH_NS + round(index * APART_S * 1e9)
        made = replace(simulated_run(bench, plan, "simulated"), started_at_ns=started_at_ns)
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


def _skewed(recording: Recording, seed: int) -> Recording:
    """Return the recording as a logger with a clock of its own would have dated it."""
    random = np.random.default_rng(seed)
    skew = 1.0 + 1e-4 * random.uniform(-1.0, 1.0)
    jitter_s = 2e-6 * random.uniform(-1.0, 1.0, len(recording))
    return replace(recording, time_s=recording.time_s * skew + jitter_s)


def plans_of(excitation: str) -> list[RunPlan]:
    """Return the runs of an excitation, `RUNS` of them."""
    usual = load_protocol("diagnosis")
    if excitation == "one spring":
        return [_sprung(plan) for plan in usual.plans()]
    if excitation == "constant speed":
        return [_steady(index) for index in range(RUNS)]
    if excitation == "rests":
        moving = usual.plans()[: RUNS - 6]
        resting = Protocol.model_validate({"name": "diagnosis", "runs": [DWELLS]}).plans()
        numbered = [*moving, *resting]
        return [
            RunPlan(f"{k:03d}-{p.name[4:]}", p.target_angle_rad, p.load_command_a, p.conditions)
            for k, p in enumerate(numbered)
        ]
    return usual.plans()


def wrist_motion(excitation: str, index: int) -> dict[str, float]:
    """Return the motion of the wrist in one run, as parameters of the plant; none where it is held.

    Each run has another pose and period, without a common period of the jaw's motion.
    """
    if excitation != "wrist":
        return {}
    return {
        "wrist_middle_rad": (-0.2, 0.1, 0.3, 0.0, -0.35)[index % 5],
        "wrist_swing_rad": (0.4, 0.55, 0.3)[index % 3],
        "wrist_period_s": 2.3 + 0.37 * index,
    }


def _sprung(plan: RunPlan) -> RunPlan:
    """Return the run against one spring: the load is a function of the angle in every run."""
    load = 0.1 + 0.7 * np.clip(plan.target_angle_rad + 1.05, 0.0, None)
    name = "-".join(plan.name.split("-")[:2])
    conditions = {k: v for k, v in plan.conditions.items() if k != "load_command_a"}
    return RunPlan(name, plan.target_angle_rad, load, conditions)


def _steady(index: int) -> RunPlan:
    """Return a run at one speed either way, against one of several loads."""
    load = (0.1, 0.3, 0.5, 0.7, 0.9)[index % 5]
    start = -1.0 + 0.05 * (index % 3)
    angle = trajectory.speed_staircase(start, 0.7, [0.5] * 5, 1e-3)
    conditions: dict[str, float | str] = {"load_command_a": load, "jaw_start_rad": start}
    return RunPlan(f"{index:03d}-steady", angle, np.full(angle.size, load), conditions)


def cases(seed: int, counts: Mapping[str, int] = COUNTS) -> Iterator[Case]:
    """Yield the cases of a seed, the classes in turn."""
    return in_turn(KINDS, counts, partial(_case, seed))


def _case(seed: int, kind: str, number: int) -> Case:
    answer = draw(kind, number, seed)
    truth = truth_of(answer)
    case = Case(
        f"{kind}-{number}",
        kind,
        partial(write, answer),
        partial(scoring.judge, truth),
    )
    if kind == "clean":
        return case
    case = replace(case, write_without=partial(write, replace(answer, effects=())))
    if kind != "confounded":
        return case
    return replace(
        case,
        write_next=partial(write_next, answer),
        judge_next=partial(scoring.judge_next, truth),
    )


def truth_of(answer: Answer) -> scoring.Truth:
    """Return the hidden truth in the form of an answer."""
    plans = plans_of(answer.excitation)
    hidden = [
        scoring.Hidden({t.family, *t.accepted}, t.equations, t.depends_on)
        for t in (TRUTHS[effect.name] for effect in answer.effects)
    ]
    runs = [plans[index].name for index in answer.runs]
    return scoring.Truth(answer.kind, hidden, runs, answer.either)
