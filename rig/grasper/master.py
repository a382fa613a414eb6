"""The master of the 3-DOF grasper: three potentiometers on its joints, 12-bit converters."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from estimation.recording import FloatArray
from rig.grasper.coupling import Coupling, GrasperError

TOP_COUNT = 4095


@dataclass(frozen=True, slots=True)
class Pot:
    """One potentiometer: `angle = (count - zero_count) * rad_per_count`.

    Attributes:
        zero_count: Count at the joint's zero.
        rad_per_count: Turn of the joint for a count; its sign is that of the mounting.
    """

    zero_count: float = 2048.0
    rad_per_count: float = np.radians(300.0) / TOP_COUNT

    def __post_init__(self) -> None:
        if not (np.isfinite(self.rad_per_count) and self.rad_per_count != 0.0):
            raise GrasperError(
                f"A potentiometer of {self.rad_per_count} rad a count shows nothing."
            )


@dataclass(frozen=True)
class Master:
    """Joint angles from the counts of yaw, pitch and grasp, and what they ask of the motors.

    Attributes:
        pots: Of yaw, pitch and grasp.
        grasper: What is commanded.
    """

    pots: tuple[Pot, Pot, Pot]
    grasper: Coupling

    def joint_rad(self, counts: ArrayLike) -> FloatArray:
        """Return yaw, pitch and grasp, shape (..., 3), from counts of that shape.

        Raises:
            GrasperError: A count is at a rail: the potentiometer is at its end, or its wire broken.
        """
        read = np.asarray(counts, dtype=np.float64)
        if not ((read > 0) & (read < TOP_COUNT)).all():
            raise GrasperError(
                "A potentiometer of the master reads its rail.",
                "It is at its end, or its wire is broken; the motors must not follow it.",
            )
        zeros = np.array([pot.zero_count for pot in self.pots])
        slopes = np.array([pot.rad_per_count for pot in self.pots])
        return np.asarray((read - zeros) * slopes)

    def counts(self, joint_rad: ArrayLike) -> FloatArray:
        """Return the counts a converter gives at joint angles, whole numbers, shape (..., 3)."""
        zeros = np.array([pot.zero_count for pot in self.pots])
        slopes = np.array([pot.rad_per_count for pot in self.pots])
        read = np.round(np.asarray(joint_rad, dtype=np.float64) / slopes + zeros)
        return np.asarray(np.clip(read, 0.0, TOP_COUNT))

    def motor_rad(self, counts: ArrayLike) -> FloatArray:
        """Return the positions the three motors are sent to, shape (..., 3).

        Raises:
            GrasperError: A count is at a rail.
            JointLimitError: A joint is asked beyond its limits.
        """
        joints = self.joint_rad(counts)
        self.grasper.check_limits(joints)
        return self.grasper.actuator_position(joints)
