"""Motor current of a drive without a torque sensor: what turning alone costs, and its driver.

While the shaft turns steadily and unloaded

    i = F sgn(v) + b v + c,

F the current that friction takes, below which no grip shows, b that of damping, and c the zero of
the current's measurement. Without a torque sensor the torque constant is that of the data sheet.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.chain import CURRENT
from calibration.linear import CalibrationSet
from calibration.procedure import Conclusion, Measurement, Residuals, Result, Step
from calibration.quality import check_change, check_levels
from calibration.regression import Regression, regress
from calibration.sessions.motion import moves, need_channel, steady
from estimation.recording import FloatArray

COMMAND = "motor_command_ratio"
LEAST_RUNS = 6
MOST_LATE = 6
"""Delays tried, samples."""


@dataclass(frozen=True, kw_only=True)
class DriveCurrentSession:
    """Calibrate the current of an unloaded drive.

    Attributes:
        speeds_rad_s: Speeds of the shaft; at least two.
        repeats: Number of moves of each.
        motor_constant_n_m_a: Torque at the shaft an ampere, by the data sheet.
    """

    speeds_rad_s: tuple[float, ...]
    repeats: int = 1
    motor_constant_n_m_a: float | None = None

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
        late = int(np.argmin([_current_of(runs, (COMMAND,)).residual_rms for runs in tried]))
        runs = tried[late]
        currents = need_channel(np.concatenate([run[CURRENT] for run in runs]), CURRENT)
        commands = np.concatenate([run[COMMAND] for run in runs])
        check_change(currents, 0.005, "The current")
        speeds = np.array([float(m.recording.conditions["speed_rad_s"]) for m in measurements])
        check_levels(speeds, 2, "The speed")
        turning = regress(
            [
                (
                    np.column_stack(
                        [
                            run["direction"],
                            run["spindle_velocity_rad_s"],
                            np.ones(len(run[CURRENT])),
                        ]
                    ),
                    run[CURRENT],
                )
                for run in runs
            ],
            least_runs=LEAST_RUNS,
        )
        driver = regress(
            [(np.column_stack([r[COMMAND], np.ones_like(r[COMMAND])]), r[CURRENT]) for r in runs],
            least_runs=LEAST_RUNS,
        )
        friction, damping, zero = turning.values.tolist()
        half = turning.half_widths().tolist()
        constant = self.motor_constant_n_m_a
        found: dict[str, float | str] = {
            "friction_current_a": friction,
            "friction_current_ci95_a": half[0],
            "damping_current_at_1_rad_s_a": damping,
            "damping_current_at_1_rad_s_ci95_a": half[1],
            "zero_current_a": zero,
            "delay_of_the_drive_s": late / measurements[0].recording.sample_rate_hz,
            "friction_torque": "no torque constant was given"
            if constant is None
            else f"{friction * constant:.3g} N m by the data sheet's constant",
        }
        fit = driver.as_fit("driver", "gain_a", "offset_a")
        series = {
            m.recording.name: (run["spindle_velocity_rad_s"], left * 1e3)
            for m, run, left in zip(measurements, runs, turning.residuals, strict=True)
        }
        low, high = float(commands.min()), float(commands.max())
        return Conclusion(
            (Result(CURRENT, COMMAND, fit, low, high),),
            found,
            Residuals("speed, rad/s", "residual, mA", series),
        )


def _late_by(measurement: Measurement, samples: int) -> Measurement:
    """Return a measurement whose commands are so many samples older."""
    recording = measurement.recording
    command = recording[COMMAND]
    older = np.concatenate([np.full(samples, command[0]), command[: len(command) - samples]])
    return replace(
        measurement, recording=replace(recording, columns={**recording.columns, COMMAND: older})
    )


def _current_of(runs: Sequence[dict[str, FloatArray]], names: Sequence[str]) -> Regression:
    """Regress the current on channels and a constant."""
    return regress(
        [
            (np.column_stack([*(run[n] for n in names), np.ones(len(run[CURRENT]))]), run[CURRENT])
            for run in runs
        ],
        least_runs=LEAST_RUNS,
    )
