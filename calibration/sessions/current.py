"""Motor current against the torque sensor at the spindle: torque constant, friction, driver.

While the spindle moves steadily the sensor at the spindle measures

    T = K i - F sgn(v) - b v + c,

K the motor's torque constant times the gear's ratio times its efficiency, F the friction of motor
and gear at the spindle, c the remaining zeros. F / K is the current that only turns the drive.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibration.chain import CURRENT, GEAR
from calibration.linear import CalibrationSet
from calibration.procedure import Conclusion, Measurement, Residuals, Result, Step
from calibration.quality import BadDataError, check_change, check_levels, check_limit
from calibration.regression import refuse_drift, regress
from calibration.sessions.motion import moves, need_channel, steady
from estimation.recording import FloatArray

TORQUE, COMMAND = GEAR.torque, "motor_command_ratio"
LOADS_A = (0.1, 0.3, 0.5, 0.7, 0.9)
SPEEDS_RAD_S = (0.5, 1.0)


@dataclass(frozen=True, kw_only=True)
class CurrentSession:
    """Calibrate the motor's current as a torque sensor.

    Attributes:
        loads_a: Loads to move against.
        speeds_rad_s: Speeds of the spindle.
        repeats: Number of moves of each.
        motor_constant_n_m_a: Torque constant of the data sheet; with the ratio gives an efficiency.
        gear_ratio: Ratio of the gear by its label.
        residual_limit: Greatest residual that passes, share of the span of torque.
    """

    loads_a: tuple[float, ...] = LOADS_A
    speeds_rad_s: tuple[float, ...] = SPEEDS_RAD_S
    repeats: int = 1
    motor_constant_n_m_a: float | None = None
    gear_ratio: float = GEAR.ratio
    residual_limit: float = 0.1

    kind = "current"
    devices = ("logger",)

    def steps(self) -> list[Step]:
        """One move a load, speed and repeat."""
        return moves(self.speeds_rad_s, self.loads_a, self.repeats)

    def conclude(self, measurements: Sequence[Measurement], lines: CalibrationSet) -> Conclusion:
        """Return the torque a current gives, and the current a command gives."""
        runs = [steady(m, (CURRENT, TORQUE, COMMAND)) for m in measurements]
        currents = need_channel(np.concatenate([run[CURRENT] for run in runs]), CURRENT)
        torques = need_channel(np.concatenate([run[TORQUE] for run in runs]), TORQUE)
        check_change(currents, 0.05, "The current")
        check_change(torques, 0.02, "The torque")
        loads = np.array([float(m.recording.conditions["load_command_a"]) for m in measurements])
        check_levels(loads, 3, "The load")
        torque = regress([equation(run) for run in runs], least_runs=6)
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
        check_limit(
            "not_linear", torque.residual_rms / span, self.residual_limit, "The residual", fix
        )
        drift = refuse_drift(torque, span)
        driver = regress(
            [(np.column_stack([r[COMMAND], np.ones_like(r[COMMAND])]), r[CURRENT]) for r in runs],
            least_runs=6,
        )
        low, high = float(currents.min()), float(currents.max())
        half = torque.half_widths()
        found: dict[str, float | str] = {
            "torque_constant_ci95_n_m_a": float(half[0]),
            "friction_current_a": float(friction / gain),
            "efficiency_ratio": "no torque constant of the motor was given"
            if self.motor_constant_n_m_a is None
            else float(gain / (self.motor_constant_n_m_a * self.gear_ratio)),
            "drift_ratio": drift,
            "witness_rms_n_m": float(np.sqrt(torque.held_out.mean())),
        }
        names = ("torque_constant_n_m_a", "friction_n_m", "damping_n_m_s_rad", "offset_n_m")
        torque_fit = torque.as_fit("current", *names)
        driver_fit = driver.as_fit("driver", "gain_a", "offset_a")
        series = {
            m.recording.name: (run[CURRENT], left * 1e3)
            for m, run, left in zip(measurements, runs, torque.residuals, strict=True)
        }
        commands = np.concatenate([run[COMMAND] for run in runs])
        return Conclusion(
            (
                Result("spindle_torque_n_m", CURRENT, torque_fit, low, high),
                Result(CURRENT, COMMAND, driver_fit, float(commands.min()), float(commands.max())),
            ),
            found,
            Residuals("motor current, A", "residual, mN m", series),
        )


def equation(run: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return the columns of the torque's equation in a run, shape (n, 4), and the torque."""
    current, speed = run[CURRENT], run["spindle_velocity_rad_s"]
    columns = np.column_stack([current, -run["direction"], -speed, np.ones_like(current)])
    return columns, run[TORQUE]
