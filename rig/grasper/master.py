"""The master of the 3-DOF grasper: three potentiometers on its joints, 12-bit converters."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from estimation.recording import FloatArray
from rig.configuration.config import Config
from rig.grasper.coupling import GrasperError
from rig.grasper.settings import master_section

TOP_COUNT = 4095


@dataclass(frozen=True, slots=True)
class Master:
    """Joint angles from counts: `angle = (count - zero_count) * rad_per_count`.

    Attributes:
        zero_counts: Counts at the zeros of yaw, pitch and grasp.
        rad_per_count: Turn of each joint for a count; its sign is that of the mounting.
    """

    zero_counts: tuple[float, float, float]
    rad_per_count: tuple[float, float, float]

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
        return np.asarray((read - self.zero_counts) * self.rad_per_count)


def master_of(config: Config) -> Master:
    """Return the master as a configuration describes it."""
    section = master_section(config)
    return Master(section.zero_counts, section.rad_per_count)
