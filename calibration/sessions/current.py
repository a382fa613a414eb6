"""Motor current against the torque sensor at the spindle: torque constant, friction, driver.

While the spindle moves steadily the sensor at the spindle measures

    T = K i - F sgn(v) - b v + c,

K the motor's torque constant times the gear's ratio times its efficiency, F the friction of motor
and gear at the spindle, c the remaining zeros. F / K is the current that only turns the drive.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.chain import CURRENT, GEAR
from calibration.linear import CalibrationSet
from calibration.procedure import Conclusion, Measurement, Residuals, Result, Step
from calibration.quality import BadDataError, check_change, check_levels, check_limit
from calibration.regression import Regression, refuse_drift, regress
from calibration.sessions.motion import condition, joined, moves, residuals, steady
from estimation.recording import FloatArray

TORQUE, COMMAND = GEAR.torque, "motor_command_ratio"
LOADS_A = (0.1, 0.3, 0.5, 0.7, 0.9)
SPEEDS_RAD_S = (0.5, 1.0)
LEAST_RUNS = 6
RESIDUAL_LIMIT = 0.1
"""Greatest residual that passes, share of the span of torque."""
MOST_LATE = 6
"""Delays tried, samples."""


@dataclass(frozen=True, kw_only=True)
class CurrentSession:
    """Calibrate the motor's current as a torque sensor."""

    loads_a: tuple[float, ...] = LOADS_A  # loads to move against
    speeds_rad_s: tuple[float, ...] = SPEEDS_RAD_S  # speeds of the spindle
    repeats: int = 1  # number of moves of each
    # torque constant of the data sheet; with the ratio gives an efficiency
    motor_constant_n_m_a: float | None = None
    gear_ratio: float = GEAR.ratio  # ratio of the gear by its label

    kind = "current"
    devices = ("logger",)

    def steps(self) -> list[Step]:
        """One move a load, speed and repeat."""
        return moves(self.speeds_rad_s, self.loads_a, self.repeats)

    def conclude(self, measurements: Sequence[Measurement], lines: CalibrationSet) -> Conclusion:
        """Return the torque a current gives, and the current a command gives."""
        runs = [steady(m, (CURRENT, TORQUE, COMMAND)) for m in measurements]
        currents = joined(runs, CURRENT)
        torques = joined(runs, TORQUE)
        check_change(currents, 0.05, "The current")
        check_change(torques, 0.02, "The torque")
        check_levels(condition(measurements, "load_command_a"), 3, "The load")
        torque = regress([equation(run) for run in runs], LEAST_RUNS)
        gain, friction = torque.values[:2]
        if gain <= 0:
            raise BadDataError(
                "not_monotone",
                f"The torque falls by {-gain:.3g} N m an ampere.",
                "Closing is positive in every channel.",
                "Check the sign of the current's and the torque sensor's calibration.",
            )
        span = float(np.ptp(torques))
        fix = "Look for a tight spot, a loose coupling, or another effect with `rig diagnose`."
        check_limit("not_linear", torque.residual_rms / span, RESIDUAL_LIMIT, "The residual", fix)
        drift = refuse_drift(torque, span)
        driver = _driver(runs)
        low, high = float(currents.min()), float(currents.max())
        half = torque.half_widths()
        efficiency: float | str = "no torque constant of the motor was given"
        if self.motor_constant_n_m_a is not None:
            efficiency = float(gain / (self.motor_constant_n_m_a * self.gear_ratio))
        found: dict[str, float | str] = {
            "torque_constant_ci95_n_m_a": float(half[0]),
            "friction_current_a": float(friction / gain),
            "efficiency_ratio": efficiency,
            "drift_ratio": drift,
            "witness_rms_n_m": float(np.sqrt(torque.held_out.mean())),
        }
        names = ("torque_constant_n_m_a", "friction_n_m", "damping_n_m_s_rad", "offset_n_m")
        torque_fit = torque.as_fit("current", *names)
        series = residuals(measurements, [run[CURRENT] for run in runs], torque)
        result = Result("spindle_torque_n_m", CURRENT, torque_fit, low, high)
        shown = Residuals("motor current, A", "residual, mN m", series)
        return Conclusion((result, driver), found, shown)


@dataclass(frozen=True, kw_only=True)
class DriveCurrentSession:
    """Calibrate the current of an unloaded drive without a torque sensor."""

    speeds_rad_s: tuple[float, ...]  # speeds of the shaft; at least two
    repeats: int = 1  # number of moves of each
    motor_constant_n_m_a: float | None = None  # torque at the shaft an ampere, by the data sheet

    kind = "current"
    devices = ("logger",)

    def steps(self) -> list[Step]:
        """One move a speed and repeat, enough of them for an interval."""
        repeats = max(self.repeats, -(-LEAST_RUNS // len(self.speeds_rad_s)))
        return moves(self.speeds_rad_s, (0.0,), repeats)

    def conclude(self, measurements: Sequence[Measurement], lines: CalibrationSet) -> Conclusion:
        """Return the current that turning takes, and the current a command gives."""
        # a drive measures before it takes the command of the same cycle: the delay fits best
        tried = [
            [steady(_late_by(m, late), (CURRENT, COMMAND)) for m in measurements]
            for late in range(MOST_LATE)
        ]
        late = int(np.argmin([_current_by_command(runs).residual_rms for runs in tried]))
        runs = tried[late]
        currents = joined(runs, CURRENT)
        check_change(currents, 0.005, "The current")
        check_levels(condition(measurements, "speed_rad_s"), 2, "The speed")
        turning = regress([_turning(run) for run in runs], LEAST_RUNS)
        friction, damping, zero = turning.values.tolist()
        half = turning.half_widths().tolist()
        torque = "no torque constant was given"
        if self.motor_constant_n_m_a is not None:
            torque = f"{friction * self.motor_constant_n_m_a:.3g} N m by the data sheet's constant"
        found: dict[str, float | str] = {
            "friction_current_a": friction,
            "friction_current_ci95_a": half[0],
            "damping_current_at_1_rad_s_a": damping,
            "damping_current_at_1_rad_s_ci95_a": half[1],
            "zero_current_a": zero,
            "delay_of_the_drive_s": late / measurements[0].recording.sample_rate_hz,
            "friction_torque": torque,
        }
        velocities = [run["spindle_velocity_rad_s"] for run in runs]
        series = residuals(measurements, velocities, turning)
        shown = Residuals("speed, rad/s", "residual, mA", series)
        return Conclusion((_driver(runs),), found, shown)


def equation(run: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return the columns of the torque's equation in a run, shape (n, 4), and the torque."""
    current, speed = run[CURRENT], run["spindle_velocity_rad_s"]
    columns = np.column_stack([current, -run["direction"], -speed, np.ones_like(current)])
    return columns, run[TORQUE]


def _turning(run: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    columns = [run["direction"], run["spindle_velocity_rad_s"], np.ones_like(run[CURRENT])]
    return np.column_stack(columns), run[CURRENT]


def _current_by_command(runs: Sequence[Mapping[str, FloatArray]]) -> Regression:
    commands = [np.column_stack([run[COMMAND], np.ones_like(run[COMMAND])]) for run in runs]
    return regress([(x, run[CURRENT]) for x, run in zip(commands, runs, strict=True)], LEAST_RUNS)


def _driver(runs: Sequence[Mapping[str, FloatArray]]) -> Result:
    """Return the line from command to current."""
    commands = np.concatenate([run[COMMAND] for run in runs])
    fit = _current_by_command(runs).as_fit("driver", "gain_a", "offset_a")
    return Result(CURRENT, COMMAND, fit, float(commands.min()), float(commands.max()))


def _late_by(measurement: Measurement, samples: int) -> Measurement:
    """Return a measurement whose commands are so many samples older."""
    recording = measurement.recording
    command = recording[COMMAND]
    older = np.concatenate([np.full(samples, command[0]), command[: len(command) - samples]])
    return replace(
        measurement, recording=replace(recording, columns={**recording.columns, COMMAND: older})
    )
