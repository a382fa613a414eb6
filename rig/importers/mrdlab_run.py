"""Turn one MRDLab log into a recording: SI units, closing-positive signs, conditions, flags.

Zeros of the encoders are left as logged. The motor's and the jaw's zero differ from folder to
folder and step when a gear or cable slips. They are stated and never taken off, because an offset
taken from a whole run carries that run's mean load into every sample:

- `motor_zero_offset_rad`: median of motor angle - 35 x spindle angle, on the motor's side;
- `jaw_zero_offset_rad`: jaw angle at spindle angle zero, from a line fitted to the run. The load
  stretches the cable, so it falls with the load; compare runs of equal load (`jaw_steps`).
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import leastsq

from estimation.recording import FloatArray, Recording, read_only
from rig.importers import mrdlab_text as raw
from rig.importers.mrdlab_flags import bad_stretches
from rig.importers.mrdlab_identity import follows, identify

SPINDLE_RAD = 2 * np.pi / 8192
MOTOR_RAD = 2 * np.pi / 4096
JAW_RAD = np.deg2rad(0.09)
TORQUE_N_M = 0.000039811
GEAR_RATIO = 35.0

CLOSING_SIGN = {raw.SPINDLE: -1.0, raw.COMMAND: -1.0, raw.DISTAL: -1.0, raw.TARGET: -1.0}
"""Raw channels that fall on closing (left jaw). Motor, jaw, current and proximal torque rise.

All of them turn on a right jaw (`mrdlab_identity`)."""

TARGET_UNITS = {"counts": SPINDLE_RAD, "rad": 1.0}
TARGET_TOLERANCE_RATIO = 2.0
FIT_PERIOD_S = 0.04
"""Samples are thinned to this spacing for the fit: hand and rig trajectories stay below 5 Hz."""
SINE_SHARE_RATIO = 0.97
"""A trajectory is one sine where the fit explains this share of its variance."""
QUANTA_RATIO = (1.0, 0.1, 0.01, 0.001, 1e-4)
COARSE_COMMAND_RATIO = 0.005
"""A quantum of 0.01 is 20 mN m at the spindle; 1e-4 is far below the sensor's noise."""
USUAL_DURATION_S = 20.0
THINNING = 10
"""Zeros and slopes are fitted to every tenth sample; short dot products stay off BLAS threads."""


@dataclass(frozen=True, slots=True)
class Sine:
    """A fitted trajectory centre + amplitude sin(2 pi f t + phase)."""

    frequency_hz: float
    centre_rad: float
    amplitude_rad: float
    phase_rad: float

    def angle_rad(self, time_s: FloatArray) -> FloatArray:
        """Return the sine at these times, shape of `time_s`."""
        phase = 2 * np.pi * self.frequency_hz * time_s + self.phase_rad
        return np.asarray(self.centre_rad + self.amplitude_rad * np.sin(phase))


def load_run(path: Path, name: str, source: str, companions: str) -> Recording:
    """Read one log as a recording.

    `companions` is the text of the folder's read-me and becomes part of the notes.

    Returns:
        Channels `spindle_angle_rad`, `motor_angle_rad` (motor side, before the gear),
        `jaw_angle_rad`, `proximal_torque_n_m`, `distal_torque_n_m`, `motor_current_a`,
        `motor_command_ratio`, `load_command_a` and, where the log holds one, `target_angle_rad`.

    Raises:
        DataError: The file is not a whole log; names the file, the line and what was expected.
    """
    text = raw.read_text(path)
    identity = identify(path, text.header, text.columns)
    remarks = [*identity.remarks]
    duration_s = float(text.columns[raw.TIME, -1] - text.columns[raw.TIME, 0])
    if abs(duration_s - USUAL_DURATION_S) >= 0.5:
        remarks.insert(0, f"The run lasts {duration_s:.2f} s; runs of this rig usually last 20 s.")
    text.columns[raw.MIRRORED] *= identity.sign
    time_s = read_only(text.columns[raw.TIME])  # a copy: the text's block can be freed
    columns = _channels(text.columns, remarks)
    target = _target(text.columns, remarks)
    if target is not None:
        columns["target_angle_rad"] = target
    sine = _sine(time_s, columns["spindle_angle_rad"] if target is None else target)
    if sine is None:
        remarks.append(
            "The trajectory is not one sine: no frequency is stated, runaways are not looked for."
        )
    conditions = identity.conditions | _conditions(columns, sine, remarks)
    for values in columns.values():
        values.flags.writeable = False  # handed over: the recording need not copy
    recording = Recording(
        name=name,
        time_s=time_s,
        columns=columns,
        conditions=conditions,
        rig="MRDLab",
        instrument=identity.instrument,
        notes="\n".join([*remarks, *([companions] * bool(companions))]),
        source=source,
    )
    if sine is not None and target is None:
        target = sine.angle_rad(time_s)
    intended = None if sine is None else target
    for stretch in bad_stretches(recording, intended, raw.STEP_S, GEAR_RATIO):
        recording = recording.with_stretch(stretch)
    return recording


def _channels(columns: FloatArray, remarks: list[str]) -> dict[str, FloatArray]:
    scales = {
        "spindle_angle_rad": (raw.SPINDLE, SPINDLE_RAD),
        "motor_angle_rad": (raw.MOTOR, MOTOR_RAD),
        "jaw_angle_rad": (raw.JAW, JAW_RAD),
        "proximal_torque_n_m": (raw.PROXIMAL, TORQUE_N_M),
        "distal_torque_n_m": (raw.DISTAL, TORQUE_N_M),
        "motor_current_a": (raw.CURRENT, 1.0),
        "motor_command_ratio": (raw.COMMAND, 1.0),
        "load_command_a": (raw.LOAD, 1.0),
    }
    channels = {
        name: columns[index] * (CLOSING_SIGN.get(index, 1.0) * scale)
        for name, (index, scale) in scales.items()
    }
    for name in ("motor_angle_rad", "jaw_angle_rad"):
        if not follows(channels["spindle_angle_rad"], channels[name]):
            channels[name] *= -1.0
            remarks.append(
                f"{name} was logged with the opposite sign and turned: it is geared to the spindle."
            )
    if float(columns[raw.LOAD].mean()) < 0:
        channels["load_command_a"] *= -1.0
        remarks.append("The load command was logged negative and turned: a load opens the jaw.")
    return channels


def _target(columns: FloatArray, remarks: list[str]) -> FloatArray | None:
    """Return the target in rad, or None; its unit is found by fitting it to the spindle.

    Newer logs hold counts, older ones rad, some only zeros. Target and spindle share their zero, so
    the slope of a fit through the origin distinguishes counts (1) from rad (2 pi / 8192).
    """
    target = columns[raw.TARGET]
    if not target.any():
        remarks.append("The target column holds zeros only; the channel is left out.")
        return None
    spindle = columns[raw.SPINDLE, ::THINNING]
    energy = float(spindle @ spindle)
    slope = float(target[::THINNING] @ spindle) / energy if energy > 0 else 0.0
    for unit, rad in TARGET_UNITS.items():
        expected = SPINDLE_RAD / rad
        if expected / TARGET_TOLERANCE_RATIO < slope < expected * TARGET_TOLERANCE_RATIO:
            if unit != "counts":
                remarks.append(f"The target column is in {unit}, not in counts.")
            angle_rad: FloatArray = target * (CLOSING_SIGN[raw.TARGET] * rad)
            return angle_rad
    remarks.append(
        f"The target column fits the spindle by {slope:.3g}, neither as counts (1) nor as rad "
        f"({SPINDLE_RAD:.3g}); the channel is left out."
    )
    return None


def _sine(time_s: FloatArray, angle_rad: FloatArray) -> Sine | None:
    """Fit one sine to an evenly sampled trajectory, started at the largest line of the spectrum.

    The frequency is that of the trajectory, never of a file name. None where there is no sine: a
    constant trajectory, fewer than 16 thinned samples, less than 0.9 of a period, or another form.
    """
    period_s = (time_s[-1] - time_s[0]) / (time_s.size - 1)
    step = max(1, round(FIT_PERIOD_S / period_s))
    t, y = time_s[::step] - time_s[0], angle_rad[::step]
    variance = float(np.var(y))
    if t.size < 16 or variance == 0.0:
        return None
    padded = 8 * t.size
    spectrum = np.fft.rfft(y - y.mean(), padded)
    line = int(np.argmax(np.abs(spectrum[1:]))) + 1
    phase = float(np.angle(spectrum[line])) + np.pi / 2
    frequency = line / (padded * period_s * step)
    start = [frequency, float(y.mean()), math.sqrt(2 * variance), phase]

    def off(values: FloatArray) -> FloatArray:
        return Sine(*values).angle_rad(t) - y

    found, *_ = leastsq(off, start, full_output=True)
    frequency, centre, amplitude, phase = map(float, found)
    if frequency * t[-1] < 0.9 or 1.0 - float(np.var(off(found))) / variance < SINE_SHARE_RATIO:
        return None
    phase += (amplitude < 0) * np.pi - 2 * np.pi * frequency * float(time_s[0])
    return Sine(frequency, centre, abs(amplitude), phase)


def _conditions(
    columns: dict[str, FloatArray], sine: Sine | None, remarks: list[str]
) -> dict[str, float | str]:
    conditions: dict[str, float | str] = {}
    load = columns["load_command_a"]
    if load.min() == load.max():
        conditions["load_command_a"] = float(load[0])
    else:
        remarks.append("The load command changes within the run: it is a channel, no condition.")
    if sine is not None:
        conditions["frequency_hz"] = round(sine.frequency_hz, 3)
        conditions["trajectory_centre_rad"] = round(sine.centre_rad, 3)
        conditions["trajectory_amplitude_rad"] = round(sine.amplitude_rad, 3)
    conditions["command_quantum_ratio"] = quantum = _quantum(columns["motor_command_ratio"])
    if quantum > COARSE_COMMAND_RATIO:
        remarks.append(
            f"The command is quantised to {quantum:g} (0.01 is about 20 mN m at the spindle): use "
            "the measured current instead."
        )
    spindle, motor, jaw = (
        columns[f"{n}_angle_rad"][::THINNING] for n in ("spindle", "motor", "jaw")
    )
    conditions["motor_zero_offset_rad"] = float(np.median(motor - GEAR_RATIO * spindle))
    centred = spindle - spindle.mean()
    moved = float(centred @ centred)
    slope = float(centred @ jaw) / moved if moved > 0 else 0.0
    conditions["jaw_zero_offset_rad"] = float(jaw.mean() - slope * spindle.mean())
    return conditions


def _quantum(command: FloatArray) -> float:
    """Return the largest power of ten all commands are multiples of."""
    for quantum in QUANTA_RATIO:
        # the first samples rule most quanta out
        if _multiples(command[:256], quantum) and _multiples(command, quantum):
            return quantum
    return 0.0


def _multiples(values: FloatArray, quantum: float) -> bool:
    ticks = values / quantum
    return bool(np.all(np.abs(ticks - np.rint(ticks)) < 1e-6))
