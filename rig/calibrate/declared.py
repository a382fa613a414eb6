"""A calibration as the diagnosis takes it: what it declares, and the runs it was made from.

A resistor's calibration is `reference = calibrated`. Where weights are known exactly (`torque`,
`ft`) it is `read = applied`: the noisy side is the target, else its noise would pass for an effect.
A part's (`current`, `gearbox`, `encoder`) is the equation of its session. Samples that a session
excludes because the rig does not move steadily are flagged here: fits and searches ignore them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calibration.chain import CURRENT, PAIRS
from calibration.fsr_curve import FsrCurve
from calibration.fsr_memory import FsrMemory
from calibration.procedure import Measurement, Procedure, Result
from calibration.record import CalibrationRecord
from calibration.sessions.current import TORQUE, CurrentSession
from calibration.sessions.encoder import EncoderSession
from calibration.sessions.fsr import SMOOTH, FsrSession
from calibration.sessions.ft import AXES, FtSession
from calibration.sessions.gearbox import GearboxSession
from calibration.sessions.motion import stands
from calibration.sessions.torque import TorqueSession
from calibration.torque import STANDARD_GRAVITY_M_S2, weight_torque_n_m
from estimation.derived import zero_phase_channels
from estimation.effects import effect
from estimation.filters import LowPass
from estimation.model import Model, Term
from estimation.recording import Flag, Recording
from estimation.rest import SPINDLE_SPEED
from rig.calibrate.raw import KIND, read_raw
from rig.errors import UsageError
from rig.log.check import looks_like_log
from rig.log.reader import read_head

STEADY = LowPass(cutoff_hz=20.0, order=3)
"""Steady motion is slow; noise of the current, a regressor, would pass for creep."""


@dataclass(frozen=True)
class Declared:
    """What one calibration declares."""

    model: Model  # its equation, a model named `calibration.KIND`
    recordings: list[Recording]  # the runs it was made from


def declared_by_record(record: CalibrationRecord) -> Declared:
    """Return the declared equation of a record, and the runs it was made from.

    Raises:
        UsageError: Its kind cannot be diagnosed, or its raw logs are gone.
    """
    folders = {Path(file.path).parent for file in record.raw}
    if len(folders) != 1 or not all(Path(file.path).is_file() for file in record.raw):
        raise UsageError(
            f"The raw logs of {record.content_hash} are not where they were.",
            "Only a session of `rig calibrate` keeps them; a certificate has none.",
            f"Kinds that can be diagnosed: {', '.join(KINDS)}.",
        )
    kind, measurements, _ = read_raw(folders.pop())
    low, high = record.validity.low, record.validity.high
    result = Result(record.channel, record.input, record.fit, low, high)
    return _known(kind).declare(result, measurements)


def declared_by_folder(folder: Path) -> Declared:
    """Return the declared equation of the simplest calibration from raw logs, and its runs.

    Plain is the force-sensing resistor's curve, the gear's stiffness, the encoder's line: what a
    session may add to these is then what the diagnosis finds.

    Raises:
        UsageError: The folder holds no raw logs of one calibration.
        BadDataError: They cannot carry a calibration.
    """
    name, measurements, lines = read_raw(folder)
    kind = _known(name)
    said = {name: v for m in measurements for name, v in m.recording.conditions.items()}
    results = kind.plain(said).conclude(measurements, lines).results
    return kind.declare(results[kind.place], measurements)


def is_raw(path: Path) -> bool:
    """Return whether a path is a folder of raw logs that `rig calibrate` left."""
    if not path.is_dir():
        return False
    first = next(iter(sorted(path.glob("*.mcap"))), None)
    if first is None or not looks_like_log(first):
        return False
    run = read_head(first).run
    return run is not None and KIND in run.details


def _known(kind: str) -> "_Kind":
    if kind not in KINDS:
        raise UsageError(
            f"A calibration of the kind {kind} cannot be diagnosed.",
            "It stores no runs, or no equation is declared for it.",
            f"Kinds that can: {', '.join(KINDS)}.",
        )
    return KINDS[kind]


def _fsr(result: Result, measurements: Sequence[Measurement]) -> Declared:
    if result.low is None or result.high is None:
        raise UsageError("The calibration of the resistor states no range of voltage.")
    values = result.fit.parameters
    powers = [name for name in values if name.startswith("c") and name[1:].isdigit()]
    coefficients = tuple(values[f"c{k}"] for k in range(len(powers)))
    curve = FsrCurve(coefficients, result.low, result.high)
    gap_n, creep_ratio = values.get("loading_gap_n", 0.0), values.get("creep_ratio", 0.0)
    memory = FsrMemory(gap_n=gap_n, creep_ratio=creep_ratio)
    made = []
    for run in FsrSession().pressed(measurements):
        volts = np.clip(run.fsr_v, curve.low_v, curve.high_v)
        force = memory.force_n(curve, run.time_s, volts)
        columns = {"calibrated_n": force, "reference_n": run.force_n}
        made.append(Recording(run.name, run.time_s - run.time_s[0], columns, rig="fsr"))
    return Declared(_of_sensor("fsr", "calibrated_n", "reference_n", SMOOTH), made)


def _torque(result: Result, measurements: Sequence[Measurement]) -> Declared:
    """Each way up or down through the weights is a run."""
    line, steps = result.fit.parameters, []
    for measurement in measurements:
        said, counts = measurement.recording.conditions, measurement.counts
        if "mass_kg" not in said or counts is None:
            continue  # the shunt is not a torque
        torque = float(weight_torque_n_m(float(said["mass_kg"]), float(said["arm_m"])))
        read = (counts[result.input].astype(np.float64) - line["zero"]) * line["slope"]
        columns = {"applied_n_m": np.full(len(read), torque), "read_n_m": read}
        steps.append(replace(measurement.recording, columns=columns))
    level = np.array([step["applied_n_m"][0] for step in steps])
    way = np.sign(np.diff(level, prepend=level[0] - 1.0))
    number = np.cumsum(np.diff(way, prepend=way[0]) != 0)
    ways: dict[int, list[Recording]] = {}
    for k, step in zip(number.tolist(), steps, strict=True):
        ways.setdefault(k, []).append(step)
    made = [_in_a_row(f"way-{k}", parts) for k, parts in ways.items()]
    return Declared(_of_sensor("torque", "applied_n_m", "read_n_m", LowPass()), made)


def _ft(result: Result, measurements: Sequence[Measurement]) -> Declared:
    """Each axis of force in each round through the poses is a run, its reading less the bias."""
    tool = result.fit.parameters
    weight_n = tool["mass_kg"] * STANDARD_GRAVITY_M_S2
    rounds: dict[str, list[Recording]] = {}
    seen: list[tuple[float, ...]] = []
    for measurement in measurements:
        recording = measurement.recording
        down = tuple(float(recording.conditions[f"gravity_{axis}_ratio"]) for axis in "xyz")
        applied = np.full((len(recording), 3), weight_n) * down
        for k, axis in enumerate(AXES[:3]):
            columns = {
                "applied_n": applied[:, k],
                "second_axis_n": applied[:, (k + 1) % 3],
                "third_axis_n": applied[:, (k + 2) % 3],
                "read_n": recording[axis] - tool[f"bias_{axis}"],
            }
            run = f"round-{seen.count(down)}-{'xyz'[k]}"
            rounds.setdefault(run, []).append(replace(recording, columns=columns))
        seen.append(down)
    made = [_in_a_row(name, parts) for name, parts in rounds.items()]
    return Declared(_of_sensor("ft", "applied_n", "read_n", LowPass()), made)


def _current(result: Result, measurements: Sequence[Measurement]) -> Declared:
    if result.input != CURRENT:
        raise UsageError(
            f"{result.channel} from {result.input} is the driver's own line.",
            "What it lacks shows in the torque of the same session.",
            "Name that session's record of spindle_torque_n_m.",
        )
    speed = {"speed": SPINDLE_SPEED}
    terms = (
        Term(effect("motor.torque_constant"), 1, {"source": CURRENT}),
        Term(effect("friction.coulomb"), -1, speed),
        Term(effect("friction.viscous"), -1, speed),
        # nothing in steady motion, but a ripple shakes the motor
        Term(effect("inertia.missing"), -1, {"acceleration": "motor_acceleration_rad_s2"}),
        Term(effect("sensor.offset"), 1),
    )
    model = _of_part("current", TORQUE, terms, "Torque at the spindle from the motor's current.")
    return Declared(model, [_moving(m.recording) for m in measurements])


def _gearbox(result: Result, measurements: Sequence[Measurement]) -> Declared:
    # small against a count of the encoders, and no more than that: damping, and the friction of
    # the spindle, which twists the gear and does not reach the sensor
    terms = [
        Term(effect("compliance.link"), 1, {"load": TORQUE}),
        Term(effect("transmission.damping"), -1, {"rate": "proximal_torque_rate_n_m_s"}),
        Term(effect("friction.coulomb"), 1, {"speed": SPINDLE_SPEED}),
        Term(effect("friction.viscous"), 1, {"speed": SPINDLE_SPEED}),
    ]
    if "backlash_rad" in result.fit.parameters:
        terms.append(Term(effect("transmission.backlash"), 1, {"load": TORQUE}))
    terms.append(Term(effect("sensor.offset"), 1))
    about = "Twist of the gear under the torque at the spindle."
    model = _of_part("gearbox", "gearbox_differential_rad", tuple(terms), about)
    return Declared(model, [_moving(m.recording) for m in measurements])


def _encoder(result: Result, measurements: Sequence[Measurement]) -> Declared:
    moved = [m.recording for m in measurements if "mark_ratio" not in m.recording.conditions]
    marked = next(m.recording for m in measurements if "mark_ratio" in m.recording.conditions)
    pair = PAIRS[str(marked.conditions["encoder"])]
    terms = [
        Term(effect("transmission.ratio"), 1, {"load": "reference_angle_rad"}),
        Term(effect("compliance.link"), -1, {"load": "between_torque_n_m"}),
        Term(effect("friction.coulomb"), -1, {"speed": "reference_velocity_rad_s"}),
        Term(effect("sensor.offset"), 1),
    ]
    if "wave_sine_rad" in result.fit.parameters:
        terms.append(Term(effect("sensor.encoder_inl"), 1, {"encoder": "reference_angle_rad"}))
    about = f"{pair.channel} against {pair.reference}."
    model = _of_part("encoder", "calibrated_angle_rad", tuple(terms), about)
    made = []
    for recording in map(_moving, moved):
        columns = {
            "calibrated_angle_rad": recording[pair.channel],
            "reference_angle_rad": pair.nominal_ratio * recording[pair.reference],
            "between_torque_n_m": recording[pair.torque],
            CURRENT: recording[CURRENT],
        }
        made.append(replace(recording, columns=columns))
    return Declared(model, made)


@dataclass(frozen=True)
class _Kind:
    # its simplest session, from the conditions of its runs
    plain: Callable[[Mapping[str, float | str]], Procedure]
    # makes the declaration of a result and the measurements
    declare: Callable[[Result, Sequence[Measurement]], Declared]
    place: int = 0  # place of the result that is declared among a session's


KINDS: Mapping[str, _Kind] = {
    "fsr": _Kind(lambda said: FsrSession(curve_only=True), _fsr),
    "torque": _Kind(
        lambda said: TorqueSession(sensor=str(said.get("sensor", "proximal"))), _torque
    ),
    "ft": _Kind(lambda said: FtSession(), _ft),
    "current": _Kind(lambda said: CurrentSession(), _current),
    "gearbox": _Kind(lambda said: GearboxSession(stiffness_only=True), _gearbox),
    # its periodic error is in the second result, the comparison with the other encoder
    "encoder": _Kind(
        lambda said: EncoderSession(encoder=str(said.get("encoder", "spindle")), line_only=True),
        _encoder,
        place=-1,
    ),
}


def _of_sensor(kind: str, source: str, target: str, low_pass: LowPass) -> Model:
    """Return a line from one to the other, whose gain and zero a fit may still move."""
    gain = Term(effect("transmission.ratio"), 1, {"load": source})
    terms = (gain, Term(effect("sensor.offset"), 1))
    about = "The calibrated reading of the sensor against its reference."
    return Model(kind, f"calibration.{kind}", target, terms, about, low_pass, False, "all")


def _of_part(kind: str, target: str, terms: tuple[Term, ...], about: str) -> Model:
    return Model(kind, f"calibration.{kind}", target, terms, about, STEADY, False)


def _moving(recording: Recording) -> Recording:
    """Return a run with the samples flagged that a session excludes: at rest or turning."""
    speed = zero_phase_channels(recording, [SPINDLE_SPEED], STEADY)[SPINDLE_SPEED]
    left_out = np.where(stands(speed, recording.sample_rate_hz), np.uint8(Flag.SUSPECT), 0)
    return replace(recording, flags=(recording.flags | left_out).astype(np.uint8))


def _in_a_row(name: str, steps: Sequence[Recording]) -> Recording:
    """Return the static parts of several steps as one run, one step after the other."""
    columns = {name: np.concatenate([step[name] for step in steps]) for name in steps[0].columns}
    flags = np.concatenate([step.flags for step in steps])
    time_s = np.arange(len(flags)) / steps[0].sample_rate_hz
    return replace(steps[0], name=name, time_s=time_s, columns=columns, flags=flags, conditions={})
