"""The one interface of every grasper: a constant matrix from actuators to joints.

Cable and gear transmissions are linear in the angles, so one matrix A carries everything:
`q_joint = A q_actuator`, the same for velocities, and, since a loss-free transmission conserves
power, `tau_actuator = A^T tau_joint`.

Erratum. Zhang et al. 2022 (IEEE RA-L) print as their equation 4 a matrix that they call the one
from joint to actuator torque. Its numbers are those of A^-T, which maps actuator torque to joint
torque.
The convention here is that of the instrument files of the da Vinci Research Kit, from which the
numbers of `rig.grasper.dvrk` come.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from estimation.recording import FloatArray
from rig.errors import ExitCode, RigError


class GrasperError(RigError):
    """A geometry or a matrix that makes no working grasper."""

    exit_code = ExitCode.USAGE


@dataclass(frozen=True, eq=False)
class Coupling:
    """A loss-free transmission from actuators to joints.

    All methods take and give arrays of shape (..., n), the last axis in the order of the names.

    Attributes:
        jacobian: A, joint velocity over actuator velocity, shape (n, n).
    """

    name: str
    joints: tuple[str, ...]
    jacobian: FloatArray

    def __post_init__(self) -> None:
        size = len(self.joints)
        if self.jacobian.shape != (size, size):
            raise GrasperError(f"{self.name}: {size} joints need a matrix of {size} x {size}.")
        finite = np.isfinite(self.jacobian).all()
        if not finite or np.linalg.matrix_rank(self.jacobian) < size:
            raise GrasperError(
                f"{self.name}: the coupling matrix cannot be inverted.",
                "Some joint could not be moved by any actuator.",
            )

    def joint_position(self, actuator_rad: ArrayLike) -> FloatArray:
        """Forward kinematics: actuator angles to joint angles, rad, or velocities, rad/s."""
        return self._through(self.jacobian, actuator_rad)

    def actuator_position(self, joint_rad: ArrayLike) -> FloatArray:
        """Inverse kinematics: joint angles to actuator angles, rad, or velocities, rad/s."""
        return self._through(self._inverse, joint_rad)

    def joint_torque(self, actuator_n_m: ArrayLike) -> FloatArray:
        """Statics: actuator torques to the joint torques they hold, N m; A^-T."""
        return self._through(self._inverse.T, actuator_n_m)

    @property
    def _inverse(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self.jacobian), dtype=np.float64)

    def _through(self, matrix: FloatArray, values: ArrayLike) -> FloatArray:
        array = np.asarray(values, dtype=np.float64)
        if array.ndim == 0 or array.shape[-1] != len(self.joints):
            raise GrasperError(
                f"{self.name}: the values have shape {array.shape}.",
                f"The last axis has one value for each of {len(self.joints)} joints.",
            )
        return np.asarray(array @ matrix.T)
