"""Six-axis force sensor: bias, weight and centre of mass of its tool, and another point.

With gravity's direction g in the sensor's axes (a unit vector, from the poses),

    F = F0 + m g0 g            T = T0 + c x (m g0 g)

is linear in the bias F0, T0, the mass m and the moment m c. The torque about another point p is
T - p x F: p goes from the sensor's origin to that point, and its sign is the classic error.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from calibration.linear import CalibrationSet
from calibration.procedure import Conclusion, Measurement, Residuals, Result, Step
from calibration.quality import BadDataError, check_limit, check_points
from calibration.record import Fit
from calibration.torque import STANDARD_GRAVITY_M_S2
from estimation.recording import FloatArray

MINIMUM_POSES = 6
RESIDUAL_LIMIT = 0.05
"""Greatest residual force that passes, share of the weight."""
AXES = ("force_x_n", "force_y_n", "force_z_n", "torque_x_n_m", "torque_y_n_m", "torque_z_n_m")
POSES = (
    (0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (1, 1, 1), (-1, 1, -1),
)  # fmt: skip
"""Gravity's direction in the sensor's axes, not yet of length one."""


@dataclass(frozen=True, kw_only=True)
class FtSession:
    """Calibrate a force sensor's bias and tool.

    Attributes:
        repeats: Number of rounds; three separate sensor errors from inaccurate poses.
        jaw_m: The jaw, from the sensor's origin.
        jaw_turn_rad: Turns of the jaw's frame about the sensor's x, y and z, in that order.
    """

    repeats: int = 1
    jaw_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    jaw_turn_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)

    kind = "ft"
    devices = ("force_sensor",)

    def steps(self) -> list[Step]:
        """One step a pose."""
        steps = []
        for number, pose in enumerate(POSES * self.repeats):
            down = np.array(pose, dtype=np.float64) / np.linalg.norm(pose)
            shown = ", ".join(f"{value:+.2f}" for value in down)
            pull = {f"gravity_{k}_ratio": float(v) for k, v in zip("xyz", down, strict=True)}
            text = f"Turn the sensor so that down is ({shown}) in its axes x, y, z; let go of it."
            steps.append(Step(f"pose-{number}", pull, text, duration_s=1.0))
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
            "torque_residual_n_m": tool.torque_residual_n_m,
            "greatest_weight_torque_at_jaw_n_m": float(np.abs(at_jaw[:, 3:]).max()),
        }
        jaw = {
            **{f"jaw_{axis}_m": v for axis, v in zip("xyz", self.jaw_m, strict=True)},
            **{f"jaw_turn_{axis}_rad": v for axis, v in zip("xyz", self.jaw_turn_rad, strict=True)},
        }
        whole = tool.fit.extended(jaw)
        number = np.arange(len(down), dtype=np.float64)
        series = {axis: (number, left[:, k]) for k, axis in enumerate(AXES[:3])}
        result = Result("contact_wrench", "force_sensor", whole)
        return Conclusion((result,), found, Residuals("pose", "residual force, N", series))


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


@dataclass(frozen=True, eq=False)
class Tool:
    """The tool on the sensor, and its bias.

    Attributes:
        bias: Reading with nothing on it, N and N m, shape (6,).
        centre_m: Centre of mass from the sensor's origin, shape (3,).
        fit: All of these, with the root mean square residual of the forces, N.
        torque_residual_n_m: Root mean square residual of the torques.
    """

    bias: FloatArray
    mass_kg: float
    centre_m: FloatArray
    fit: Fit
    torque_residual_n_m: float

    def weight(self, gravity: ArrayLike) -> FloatArray:
        """Return the wrench of the weight, shape (..., 6), for directions of shape (..., 3)."""
        force = self.mass_kg * STANDARD_GRAVITY_M_S2 * np.asarray(gravity, dtype=np.float64)
        return np.concatenate([force, np.cross(self.centre_m, force)], axis=-1)

    def contact(self, wrench: ArrayLike, gravity: ArrayLike) -> FloatArray:
        """Return readings less bias and weight, shape (..., 6)."""
        return np.asarray(wrench, np.float64) - self.bias - self.weight(gravity)


def fit_tool(gravity: ArrayLike, wrench: ArrayLike) -> Tool:
    """Fit bias and tool on the mean readings of poses.

    Args:
        gravity: Direction of gravity in the sensor's axes, unit vectors, shape (n, 3).
        wrench: Mean readings, N and N m, shape (n, 6).

    Raises:
        BadDataError: Too few poses, all in one plane, no weight, or poses that contradict.
    """
    down, read = np.asarray(gravity, np.float64), np.asarray(wrench, np.float64)
    check_points(len(down), MINIMUM_POSES, "poses")
    if not np.allclose(np.linalg.norm(down, axis=1), 1.0, atol=1e-6) or not np.isfinite(read).all():
        raise BadDataError("points", "A direction is not a unit vector, or a reading no number.")
    if np.linalg.matrix_rank(down - down.mean(axis=0), tol=0.1) < 3:
        raise BadDataError(
            "levels",
            "The poses turn the sensor about one axis only.",
            "Bias and weight cannot be separated.",
            "Turn each of its axes up and down.",
        )
    pull = STANDARD_GRAVITY_M_S2 * down
    force_design = np.concatenate([np.hstack([np.eye(3), p[:, None]]) for p in pull])
    force, force_cov, force_left = _solve(force_design, read[:, :3].ravel())
    mass = float(force[3])
    deviation = float(np.sqrt(force_cov[3, 3]))
    if mass <= 5 * deviation:
        raise BadDataError(
            "no_change",
            f"The readings show a weight of {mass * 1e3:.1f} g +- {deviation * 1e3:.1f} g.",
            "A tool must be on the sensor, and gravity must point along +z when z points down.",
            "Check the poses' signs, or omit the tool's weight.",
        )
    fix = "Check the poses, and keep cables from pulling."
    weight = mass * STANDARD_GRAVITY_M_S2
    check_limit("not_linear", force_left / weight, RESIDUAL_LIMIT, "The force left over", fix)
    # c x w, with w = m g0 g and the moment m c unknown: rows of the columns' products with w
    torque_design = np.concatenate([np.hstack([np.eye(3), np.cross(p, np.eye(3))]) for p in pull])
    torque, torque_cov, torque_left = _solve(torque_design, read[:, 3:].ravel())
    centre = torque[3:] / mass
    covariance = np.zeros((10, 10))
    covariance[:3, :3], covariance[3:6, 3:6] = force_cov[:3, :3], torque_cov[:3, :3]
    covariance[6, 6] = force_cov[3, 3]
    covariance[7:, 7:] = torque_cov[3:, 3:] / mass**2
    bias = np.concatenate([force[:3], torque[:3]])
    names = [*(f"bias_{axis}" for axis in AXES), "mass_kg", *(f"centre_{k}_m" for k in "xyz")]
    values = np.array([*bias, mass, *centre]).tolist()
    parameters = dict(zip(names, values, strict=True))
    fit = Fit("tool", parameters, covariance, force_left, len(down))
    return Tool(bias, mass, centre, fit, torque_left)


def at_point(
    wrench: ArrayLike, point_m: ArrayLike, rotation: ArrayLike | None = None
) -> FloatArray:
    """Return wrenches about another point and in another frame, shape (..., 6).

    Args:
        wrench: In the sensor's frame about its origin, shape (..., 6).
        point_m: The other point, from the sensor's origin, in the sensor's frame, shape (3,).
        rotation: Rows are the other frame's axes in the sensor's, shape (3, 3); none if None.
    """
    read = np.asarray(wrench, dtype=np.float64)
    turn = np.eye(3) if rotation is None else np.asarray(rotation, dtype=np.float64)
    force = read[..., :3]
    torque = read[..., 3:] - np.cross(np.asarray(point_m, dtype=np.float64), force)
    return np.concatenate([force @ turn.T, torque @ turn.T], axis=-1)


def _solve(design: FloatArray, target: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    values: FloatArray = np.asarray(np.linalg.lstsq(design, target)[0], np.float64)
    left = target - design @ values
    variance = float(left @ left) / (len(target) - design.shape[1])
    covariance = np.asarray(variance * np.linalg.inv(design.T @ design), np.float64)
    return values, covariance, float(np.sqrt(np.mean(left**2)))
