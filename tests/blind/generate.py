"""The blind generator: recordings with an effect no model declares, and the answer elsewhere.

A case is drawn by its class, number and seed. Its folder holds logs and nothing else; the answer is
written to another folder, under a name that says nothing.
"""

import hashlib
import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from estimation.files import write_text_atomic
from estimation.recording import FloatArray, Instrument, Recording
from rig import trajectory
from rig.log.convert import write_recording
from rig.motion import motion_of
from rig.protocol import RunPlan, load_protocol
from rig.simulation.bench import SimulatedBench
from rig.simulation.fitted import DECLARED_PLANT
from rig.simulation.hidden import KINDS, NAMES, HiddenEffect
from rig.simulation.parameters import PlantParameters, SensorParameters, vary
from rig.simulation.play import play
from rig.simulation.sensors import spindle_count_of
from tests.blind.truths import CATALOGUED, OUTSIDE, TRUTHS

CLASSES = ("strong", "weak", "pair", "outside", "partial", "confounded", "control")
WEAK = 0.3
"""Strength of a weak case for one of a strong one."""

CONTROLS = ("plain", "coloured", "drifting", "skewed")
SPREAD = 0.1
EPOCH_NS = 1_700_000_000_000_000_000


@dataclass(frozen=True)
class Answer:
    """What is hidden in a case.

    Attributes:
        case: Name of its folder.
        kind: One of `CLASSES`.
        effects: The hidden effects; none in a control.
        runs: Places of the runs that have them.
        variant: How a control or a confounded case is made; else empty.
        either: For a confounded case: families that cannot be told apart on its runs.
    """

    case: str
    kind: str
    effects: tuple[HiddenEffect, ...]
    runs: tuple[int, ...]
    variant: str = ""
    either: tuple[str, ...] = ()


def draw(kind: str, number: int, seed: int) -> Answer:
    """Draw a case's answer; the same class, number and seed give the same case."""
    word = hashlib.sha256(f"{kind}/{number}/{seed}".encode()).hexdigest()
    random = np.random.default_rng(int(word[:15], 16))
    runs = tuple(range(14))
    variant, names = "", list[str]()
    either: tuple[str, ...] = ()
    if kind in ("strong", "weak", "partial"):
        names = [_cycled(sorted(CATALOGUED), number, seed)]
    elif kind == "outside":
        names = [_cycled(sorted(OUTSIDE), number, seed)]
    elif kind == "pair":
        first, second = random.choice(sorted(CATALOGUED), 2, replace=False)
        while CATALOGUED[first].names(CATALOGUED[second].family):
            first, second = random.choice(sorted(CATALOGUED), 2, replace=False)
        names = [str(first), str(second)]
    elif kind == "confounded":
        variant = ("one spring", "constant speed")[number % 2]
        other = "friction.position" if variant == "one spring" else "friction.load_viscous"
        names, either = ["gear_load_friction"], ("friction.load", other)
    elif kind == "control":
        variant = CONTROLS[number % len(CONTROLS)]
    else:
        raise ValueError(f"There is no class {kind!r}; there are {', '.join(CLASSES)}.")
    if kind == "partial":
        count = int(random.integers(5, 9))
        runs = tuple(sorted(int(k) for k in random.choice(14, count, replace=False)))
    effects = tuple(_shaped(name, random, WEAK if kind == "weak" else 1.0) for name in names)
    return Answer(f"case-{word[-10:]}", kind, effects, runs, variant, either)


def _cycled(names: list[str], number: int, seed: int) -> str:
    """Return a name such that each comes once before any comes twice."""
    order = np.random.default_rng([seed, number // len(names)]).permutation(len(names))
    return names[int(order[number % len(names)])]


def _shaped(name: str, random: np.random.Generator, share: float) -> HiddenEffect:
    kind = KINDS[NAMES.index(name)]
    shape = [float(random.uniform(part.low, part.high)) for part in kind.shapes]
    shape = [
        float(round(value)) if part.whole else value
        for value, part in zip(shape, kind.shapes, strict=True)
    ]
    strength = TRUTHS[name].scale * random.uniform(0.85, 1.15) * share
    return HiddenEffect(name, float(strength), tuple(shape))


def write(answer: Answer, cases: Path, answers: Path, runs: int | None = None) -> Path:
    """Write a case's recordings, and its answer elsewhere; returns the folder of recordings.

    Args:
        answer: From `draw`.
        cases: Folder of cases.
        answers: Folder of answers, not inside `cases`.
        runs: Only the first so many runs, for a quick look.
    """
    folder = cases / answer.case
    folder.mkdir(parents=True)
    write_text_atomic(answers / f"{answer.case}.json", json.dumps(asdict(answer), indent=1) + "\n")
    rig_seed = int(answer.case[-8:], 16)
    plant = vary(DECLARED_PLANT, rig_seed, SPREAD)
    sensors = vary(SensorParameters(), rig_seed, SPREAD)
    if answer.variant == "drifting":
        sensors = replace(
            sensors,
            proximal_ramp_n_m_s=5.0 * sensors.proximal_ramp_n_m_s,
            distal_ramp_n_m_s=5.0 * sensors.distal_ramp_n_m_s,
            torque_walk_n_m_s=3.0 * sensors.torque_walk_n_m_s,
        )
    for index, plan in enumerate(_plans(answer.variant)[:runs]):
        effects = answer.effects if index in answer.runs else ()
        recording = _record(plan, plant, sensors, effects, rig_seed * 1009 + index, index)
        recording = _disturbed(recording, answer.variant, rig_seed * 1013 + index)
        write_recording(folder / f"{plan.name}.mcap", recording)
    return folder


def _plans(variant: str) -> list[RunPlan]:
    if variant == "one spring":
        return [_sprung(plan) for plan in load_protocol("diagnosis").plans()]
    if variant == "constant speed":
        return [_steady(index) for index in range(14)]
    return load_protocol("diagnosis").plans()


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
    columns = play(
        bench, motion.target_angle_rad[: motion.last], motion.load_command_a[: motion.last]
    )
    return Recording(
        plan.name,
        np.arange(motion.last - motion.first) / trajectory.SAMPLE_RATE_HZ,
        {name: values[motion.first :] for name, values in columns.items()},
        conditions=plan.conditions,
        rig="simulated rig",
        instrument=Instrument(model="Maryland", serial="SIM-TOOL-1", side="left"),
        started_at_ns=EPOCH_NS + index * 30_000_000_000,
        source="simulated",
    )


def _disturbed(recording: Recording, variant: str, seed: int) -> Recording:
    """Return the recording of a control as a worse logger would have made it."""
    random = np.random.default_rng(seed)
    if variant == "coloured":
        n = len(recording)
        return recording.with_columns(
            proximal_torque_n_m=recording["proximal_torque_n_m"] + 0.3e-3 * _coloured(n, random),
            distal_torque_n_m=recording["distal_torque_n_m"] + 0.3e-3 * _coloured(n, random),
            motor_current_a=recording["motor_current_a"] + 1e-3 * _coloured(n, random),
        )
    if variant == "skewed":
        skew = 1.0 + 1e-4 * random.uniform(-1.0, 1.0)
        jitter_s = 2e-6 * random.uniform(-1.0, 1.0, len(recording))
        return replace(recording, time_s=recording.time_s * skew + jitter_s)
    return recording


def _coloured(n: int, random: np.random.Generator) -> FloatArray:
    """Return noise of variance 1 that forgets within 20 to 100 ms."""
    from scipy.signal import lfilter

    keep = float(np.exp(-1e-3 / random.uniform(0.02, 0.1)))
    values: FloatArray = lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], random.standard_normal(n))
    return values
