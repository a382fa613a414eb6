"""Graspers with yaw, pitch and grasp from three motors: decoupled (Zhao 2016) and coupled.

The angles of both jaws are measured in one sense about their common axis. Pitch is their mean.
Grasp is the angle of jaw 1 less that of jaw 2, and jaw 1 is the one that closes by turning in the
positive sense: closing is positive. Motor angles are those of the motor's shaft.
"""

from dataclasses import dataclass

import numpy as np

from rig.grasper.coupling import Coupling, GrasperError, Limits
from rig.grasper.wrist import CablePath, Planetary

JOINTS = ("yaw", "pitch", "grasp")
MOTORS = ("yaw_motor", "jaw_1_motor", "jaw_2_motor")

JAWS_TO_PITCH_AND_GRASP = np.array([[0.5, 0.5], [1.0, -1.0]])


@dataclass(frozen=True, slots=True)
class Drive:
    """What is between the motors and the wrist, the same for all three.

    Attributes:
        gearhead_ratio: Motor turns for one turn of the drum; 66 in the paper.
        drum_m: Diameter of the drums that pull the jaws' cables.
        carrier_pulley_over_drum: Diameter of the yaw's driven pulley over its drum's.
    """

    gearhead_ratio: float = 66.0
    drum_m: float = 0.008
    carrier_pulley_over_drum: float = 1.0

    def __post_init__(self) -> None:
        values = (self.gearhead_ratio, self.drum_m, self.carrier_pulley_over_drum)
        if not (np.isfinite(values).all() and min(values) > 0):
            raise GrasperError(f"{self}: every size is greater than zero.")


EQUAL_GEARS = Planetary(1.0)
"""The paper's wrist: equal gears, the sun fixed; yaw is twice the carrier's angle."""

PAPER_DRIVE = Drive()
"""The paper's 66:1 gearhead, with drums of 8 mm, which the paper does not state."""


def planetary_grasper(
    path: CablePath,
    planetary: Planetary = EQUAL_GEARS,
    drive: Drive = PAPER_DRIVE,
    limits: Limits | None = None,
) -> Coupling:
    """Return the grasper with the planetary wrist, driven at the carrier.

    With d2/d1 = alpha/beta each motor moves its own joint. With another pulley ratio turning the
    yaw shortens the jaws' cables by equation 5, and both jaws, so the pitch, turn along.

    Args:
        path: Pulleys of the jaws' cables.
        planetary: Gears of the wrist.
        drive: Gearheads and drums.
        limits: Limits of yaw, pitch and grasp.

    Raises:
        GrasperError: Pulleys overlap, or a cable loses contact with its pulley within the limits of
            the yaw.
    """
    path.tangent_angles_rad()
    if limits is not None:
        _check_cables_stay_on(path, planetary, max(-limits.low_rad[0], limits.high_rad[0]))
    carrier_per_motor = 1.0 / (drive.gearhead_ratio * drive.carrier_pulley_over_drum)
    beta = 1.0 / planetary.alpha_over_beta  # for a carrier angle of one
    jaw_per_carrier = -path.shortening_m(1.0, beta) / (path.d3_m / 2)
    yaw = planetary.yaw_over_carrier * carrier_per_motor
    return _grasper(
        "planetary grasper",
        yaw,
        jaw_per_carrier * carrier_per_motor,
        _jaw_per_motor(drive, path.d3_m),
        limits,
    )


def _check_cables_stay_on(path: CablePath, planetary: Planetary, yaw_rad: float) -> None:
    """Follow a jaw's two cables, of which one path is the other's mirror image, to a yaw."""
    alpha = yaw_rad / planetary.yaw_over_carrier
    for side in (alpha, -alpha):
        path.length_m(side, side / planetary.alpha_over_beta)


def _jaw_per_motor(drive: Drive, jaw_pulley_m: float) -> float:
    return drive.drum_m / jaw_pulley_m / drive.gearhead_ratio


def _grasper(
    name: str, yaw: float, jaw_by_yaw_motor: float, jaw: float, limits: Limits | None
) -> Coupling:
    jaws = np.array([[jaw_by_yaw_motor, jaw, 0.0], [jaw_by_yaw_motor, 0.0, jaw]])
    jacobian = np.vstack([[yaw, 0.0, 0.0], JAWS_TO_PITCH_AND_GRASP @ jaws])
    return Coupling(name, JOINTS, MOTORS, jacobian, limits)
