"""Six-axis force sensor with its tool in several poses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.ft import AXES, at_point, fit_tool
from calibration.linear import CalibrationSet
from calibration.procedure import Conclusion, Measurement, Residuals, Result, Step
from calibration.quality import BadDataError

POSES = (
    (0, 0, 1),
    (0, 0, -1),
    (1, 0, 0),
    (-1, 0, 0),
    (0, 1, 0),
    (0, -1, 0),
    (1, 1, 1),
    (-1, 1, -1),
)
"""Gravity's direction in the sensor's axes, not yet of length one."""


@dataclass(frozen=True, kw_only=True)
class FtSession:
    """Calibrate a force sensor's bias and tool.

    Attributes:
        poses: Directions of gravity in the sensor's axes.
        repeats: Number of rounds; three separate sensor errors from inaccurate poses.
        jaw_m: The jaw, from the sensor's origin.
        jaw_turn_rad: Turns of the jaw's frame about the sensor's x, y and z, in that order.
    """

    poses: tuple[tuple[float, float, float], ...] = POSES
    repeats: int = 1
    jaw_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    jaw_turn_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)

    kind = "ft"
    devices = ("force_sensor",)

    def steps(self) -> list[Step]:
        """One step a pose."""
        steps = []
        for number, pose in enumerate(self.poses * self.repeats):
            down = np.array(pose, dtype=np.float64) / np.linalg.norm(pose)
            shown = ", ".join(f"{value:+.2f}" for value in down)
            steps.append(
                Step(
                    f"pose-{number}",
                    {
                        f"gravity_{axis}_ratio": float(v)
                        for axis, v in zip("xyz", down, strict=True)
                    },
                    f"Turn the sensor so that down is ({shown}) in its axes x, y, z; let go of it.",
                    duration_s=1.0,
                )
            )
        return steps

    def conclude(self, measurements: Sequence[Measurement], lines: CalibrationSet) -> Conclusion:
        """Return bias, weight and centre of mass, and the way to the jaw."""
        said = measurements[0].details
        missing = [name for name in ("counts_per_n", "counts_per_n_m") if name not in said]
        if missing:
            raise BadDataError(
                "points",
                f"The sensor did not report its {missing[0]}.",
                "Counts per unit are read from the device, never assumed.",
            )
        down, read = [], []
        for measurement in measurements:
            recording = measurement.recording
            down.append([float(recording.conditions[f"gravity_{axis}_ratio"]) for axis in "xyz"])
            read.append([float(recording[axis].mean()) for axis in AXES])
            _refuse_swinging(measurement)
        tool = fit_tool(down, read)
        left = tool.contact(np.array(read), np.array(down))
        turn = Rotation.from_euler("xyz", self.jaw_turn_rad).as_matrix().T
        at_jaw = at_point(tool.weight(down), self.jaw_m, turn)
        found: dict[str, float | str] = {
            "counts_per_n": said["counts_per_n"],
            "counts_per_n_m": said["counts_per_n_m"],
            "torque_residual_n_m": tool.residual[1],
            "greatest_weight_torque_at_jaw_n_m": float(np.abs(at_jaw[:, 3:]).max()),
        }
        jaw = {
            **{f"jaw_{axis}_m": v for axis, v in zip("xyz", self.jaw_m, strict=True)},
            **{f"jaw_turn_{axis}_rad": v for axis, v in zip("xyz", self.jaw_turn_rad, strict=True)},
        }
        whole = tool.as_fit().extended(jaw)
        number = np.arange(len(down), dtype=np.float64)
        series = {axis: (number, left[:, k]) for k, axis in enumerate(AXES[:3])}
        return Conclusion(
            (Result("contact_wrench", "force_sensor", whole),),
            found,
            Residuals("pose", "residual force, N", series),
        )


def _refuse_swinging(measurement: Measurement) -> None:
    recording = measurement.recording
    for axis in AXES[:3]:
        first, last = np.array_split(recording[axis], 2)
        moved = abs(float(first.mean() - last.mean()))
        if moved > 0.1 + 3 * float(recording[axis].std()):
            raise BadDataError(
                "not_steady",
                f"{recording.name}: {axis} moves by {moved:.2g} N while it should rest.",
                fix="Hold the sensor by a stand, and wait until it is still.",
            )
