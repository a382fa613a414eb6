"""What a configuration of the 3-DOF grasper holds: limits of its motors, drift, its master."""

import math
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field

from estimation.recording import FloatArray
from rig.configuration.config import Config
from rig.configuration.machine_settings import (
    DriftSection,
    LimitsSection,
    MachineSettings,
    OwnSection,
)
from rig.configuration.sections import Angle, Current, Force, Number, Section
from rig.errors import UsageError
from rig.grasper.coupling import GrasperError

TOP_COUNT = 4095
"""Of a 12-bit converter."""
POT_RAD_PER_COUNT = math.radians(300.0) / TOP_COUNT


def _not_zero(value: float) -> float:
    if value == 0.0:
        raise ValueError("a potentiometer of 0 rad a count shows nothing")
    return value


Turn = Annotated[float, Field(ge=-0.01, le=0.01, allow_inf_nan=False), AfterValidator(_not_zero)]


class GrasperLimits(LimitsSection):
    """Limits of the 3-DOF grasper, for each of its motors: the yaw's, and those of both jaws."""

    yaw_current_a: Current
    jaw_1_current_a: Current
    jaw_2_current_a: Current
    yaw_force_n: Force
    jaw_1_force_n: Force
    jaw_2_force_n: Force
    yaw_angle_rad: Angle
    jaw_1_angle_rad: Angle
    jaw_2_angle_rad: Angle


class GrasperDrift(DriftSection):
    """Sensors of the grasper whose zero drifts."""

    yaw_force_n: Force | None = None
    jaw_1_force_n: Force | None = None
    jaw_2_force_n: Force | None = None


class MasterSection(Section):
    """The master a grasper follows: potentiometers of yaw, pitch and grasp.

    Attributes:
        url: URL, such as `usb:16c0:0483:SERIAL`; a simulated grasper has a simulated one.
        zero_counts: Counts of the converter at each joint's zero.
        rad_per_count: Turn of each joint for a count, negative where it is mounted the other way
            round; by default a potentiometer of 300 degrees over 12 bits.
    """

    url: str | None = None
    zero_counts: tuple[Number, Number, Number] = (2048.0, 2048.0, 2048.0)
    rad_per_count: tuple[Turn, Turn, Turn] = (POT_RAD_PER_COUNT,) * 3

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


class GrasperSection(OwnSection):
    """The grasper's own tables."""

    master: MasterSection = MasterSection()


SETTINGS = MachineSettings(GrasperLimits, GrasperDrift, ("teensy",), GrasperSection)


def master_section(config: Config) -> MasterSection:
    """Return the master of a grasper's configuration; UsageError for another kind of rig."""
    if not isinstance(config.machine, GrasperSection):
        raise UsageError(
            f"{config.name} is not a grasper: its profile is {config.logger.profile!r}.",
            "Only the 3-DOF grasper has a master.",
            'Name a configuration with [logger] profile = "grasper".',
        )
    return config.machine.master
