"""Trajectories of guided calibrations, and the samples of them that a fit may use."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from calibration.procedure import Measurement, Step
from calibration.quality import BadDataError
from calibration.regression import Regression
from estimation.filters import PAPER, zero_phase
from estimation.recording import FloatArray

RATE_HZ = 1000.0
START_RAD = -1.047
"""Where a calibration starts: the jaw open."""
MOVING_RAD_S = 0.2
PAUSE_S, TRAVEL_RAD = 0.3, 0.9
KEPT_HZ = 100.0


def moves(speeds_rad_s: Sequence[float], loads_a: Sequence[float], repeats: int) -> list[Step]:
    """Return one step for every load, speed and repeat, each closing and opening once.

    The speed is constant, and both ends are rested at.
    """
    steps = []
    pause = np.zeros(round(PAUSE_S * RATE_HZ))
    for repeat, load, speed in itertools.product(range(repeats), loads_a, speeds_rad_s):
        ramp = np.arange(0.0, TRAVEL_RAD, speed / RATE_HZ)
        angle = START_RAD + np.concatenate([pause, ramp, pause + TRAVEL_RAD, ramp[::-1], pause])
        name = f"move-{load:g}A-{speed:g}rad_s-{repeat}"
        held = {"load_command_a": load, "speed_rad_s": speed}
        loads = np.full(angle.size, load)
        steps.append(Step(name, held, target_angle_rad=angle, load_command_a=loads))
    return steps


def steady(measurement: Measurement, names: Sequence[str]) -> dict[str, FloatArray]:
    """Return channels where the spindle moves steadily, all low-passed alike, 100 samples a second.

    Besides the channels there is `direction`: 1 where the spindle closes, -1 where it opens, and
    `spindle_velocity_rad_s`. Samples within 0.1 s of a change of direction are left out.

    Raises:
        BadDataError: The rig did not move.
    """
    recording = measurement.recording
    rate_hz = recording.sample_rate_hz
    columns = np.column_stack([recording[name] for name in (*names, "spindle_angle_rad")])
    low_pass = PAPER.for_rate(rate_hz)
    smooth = zero_phase(columns, rate_hz, low_pass)
    velocity = np.gradient(zero_phase(smooth[:, -1], rate_hz, low_pass)) * rate_hz
    step = max(1, round(rate_hz / KEPT_HZ))
    kept = (~stands(velocity, rate_hz) & recording.valid)[::step]
    if kept.sum() < 20:
        raise BadDataError(
            "no_change",
            f"{recording.name}: the spindle barely moves.",
            f"It must be faster than {MOVING_RAD_S:g} rad/s for some tenths of a second.",
            "Check that the motor has its supply and that the jaw is free.",
        )
    found = {name: smooth[::step, k][kept] for k, name in enumerate(names)}
    found["spindle_velocity_rad_s"] = velocity[::step][kept]
    found["direction"] = np.sign(found["spindle_velocity_rad_s"])
    return found


def stands(velocity_rad_s: FloatArray, rate_hz: float) -> NDArray[np.bool_]:
    """Return which samples are slow or within 0.1 s of one that is, shape (n,)."""
    kernel = np.ones(2 * round(0.1 * rate_hz) + 1)
    slow = np.abs(velocity_rad_s) < MOVING_RAD_S
    return np.asarray(np.convolve(slow, kernel, mode="same") > 0)


def joined(runs: Sequence[Mapping[str, FloatArray]], name: str) -> FloatArray:
    """Return a channel of all runs, refusing that of a sensor that shows nothing at all."""
    values = np.concatenate([run[name] for run in runs])
    if np.ptp(values) == 0.0:
        raise BadDataError(
            "no_change",
            f"{name} reads the same all the time.",
            "A real sensor has noise; this one is not connected, or its input is stuck.",
            "Check its plug and its supply.",
        )
    return values


def condition(measurements: Sequence[Measurement], name: str) -> FloatArray:
    """Return the number that each step was measured at, shape (runs,)."""
    return np.array([float(m.recording.conditions[name]) for m in measurements])


def residuals(
    measurements: Sequence[Measurement], variables: Sequence[FloatArray], fit: Regression
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return each run's variable and residual, the latter in thousandths, for the figure."""
    rows = zip(measurements, variables, fit.residuals, strict=True)
    return {m.recording.name: (values, left * 1e3) for m, values, left in rows}
