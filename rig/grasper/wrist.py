"""The planetary wrist of Zhao & Nelson 2016: the condition for jaw cables decoupled from the yaw.

"Estimating Tool-Tissue Forces Using a 3-Degree-of-Freedom Robotic Surgical Tool", J. Mechanisms
Robotics 8(5), doi 10.1115/1.4032591. The jaw's cable passes idler pulley 1 (on the sun's axis),
pulley 2 (on the planet's axis) and ends on the jaw's pulley 3. The carrier turns by alpha; the
planet, which is the yaw output, turns by beta relative to the carrier.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from rig.grasper.coupling import Coupling, GrasperError
from rig.protocols.joints import JOINTS

MOTORS = ("yaw_motor", "jaw_1_motor", "jaw_2_motor")

GEARHEAD_RATIO, DRUM_M = 66.0, 0.008
"""The paper's gearhead, and drums that pull the jaws' cables, which the paper does not state."""

JAWS_TO_PITCH_AND_GRASP = np.array([[0.5, 0.5], [1.0, -1.0]])

GEAR_RATIOS = (1.0, 2.0, 3.0)
"""Planet over sun diameter of Table 1's first step (1:1, 1:2, 1:3 read as sun:planet)."""

SUN_CONSTRAINTS = (0.0, -1.0, -2.0)
"""Sun over carrier velocity of Table 1's second step."""

DRIVES = ("carrier", "gear 2", "gear 1")
"""Driving component, Table 1's third step: gear 1 is the sun, gear 2 the planet."""


@dataclass(frozen=True, slots=True)
class CablePath:
    """Pulleys and centre distances that a jaw's cable passes; see the paper's Figure 3.

    Attributes:
        l2_m: Distance of the centres of pulleys 1 and 2.
        l3_m: Distance of the centres of pulleys 2 and 3.
    """

    d1_m: float
    d2_m: float
    d3_m: float
    l2_m: float
    l3_m: float

    def __post_init__(self) -> None:
        sizes = (self.d1_m, self.d2_m, self.d3_m, self.l2_m, self.l3_m)
        if not all(math.isfinite(x) and x > 0 for x in sizes):
            raise GrasperError(f"{self}: diameters and centre distances are greater than zero.")

    def interference(self) -> list[str]:
        """Return which neighbouring pulleys touch; empty where the cable can cross between them."""
        gaps = {
            "pulleys 1 and 2": self.l2_m - (self.d1_m + self.d2_m) / 2,
            "pulleys 2 and 3": self.l3_m - (self.d2_m + self.d3_m) / 2,
        }
        return [f"{pair} overlap by {-gap:.4g} m" for pair, gap in gaps.items() if gap < 0]

    def tangent_angles_rad(self) -> tuple[float, float]:
        """Return theta1 and theta2 of equations 2 and 3.

        Raises:
            GrasperError: Pulleys overlap, so the angle does not exist.
        """
        if overlaps := self.interference():
            raise GrasperError(
                f"The cable path does not exist: {'; '.join(overlaps)}.",
                "A crossing cable needs room between two pulleys.",
                "Choose smaller pulleys or greater centre distances.",
            )
        return (
            math.acos((self.d1_m + self.d2_m) / (2 * self.l2_m)),
            math.acos((self.d2_m + self.d3_m) / (2 * self.l3_m)),
        )

    def shortening_m(self, alpha_rad: float, beta_rad: float) -> float:
        """Return C1 - C1', by which turning the wrist shortens the path; equation 5.

        Args:
            alpha_rad: Angle of the line from pulley 1 to 2, that is of the carrier.
            beta_rad: Angle of the line from pulley 2 to 3 relative to that line.
        """
        return self.d2_m / 2 * beta_rad - self.d1_m / 2 * alpha_rad


@dataclass(frozen=True, slots=True)
class Planetary:
    """A sun, a planet and their carrier, with one constraint on the sun.

    Attributes:
        gear_ratio: Diameter of gear 2 (planet) over gear 1 (sun).
        sun_over_carrier: Velocity of the sun over that of the carrier; 0 is a fixed sun.
    """

    gear_ratio: float
    sun_over_carrier: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.gear_ratio) and self.gear_ratio > 0):
            raise GrasperError(f"A gear ratio of {self.gear_ratio} cannot be.")
        if not (math.isfinite(self.sun_over_carrier) and self.sun_over_carrier < 1):
            raise GrasperError(
                f"A sun at {self.sun_over_carrier} times the carrier gives no yaw of its own.",
                "It must turn slower than the carrier, or backwards.",
            )

    @property
    def alpha_over_beta(self) -> float:
        """Carrier angle over the planet's angle relative to the carrier; equations 7 to 10."""
        return self.gear_ratio / (1.0 - self.sun_over_carrier)

    @property
    def yaw_over_carrier(self) -> float:
        """Output velocity omega_2 over the carrier's; 2 for equal gears and a fixed sun."""
        return 1.0 + 1.0 / self.alpha_over_beta

    @property
    def decoupling_pulley_ratio(self) -> float:
        """The d2/d1 that decouples the jaws from the yaw; equation 6."""
        return self.alpha_over_beta


EQUAL_GEARS = Planetary(1.0)
"""The paper's wrist: equal gears, the sun fixed; yaw is twice the carrier's angle."""


@dataclass(frozen=True, slots=True)
class Design:
    """One combination of Table 1.

    Attributes:
        planetary: Gear ratio and constraint.
        pulley_ratio: The d2/d1 that decouples it.
        area: Length times width of gears and pulleys, in squares of the least diameter.
        extra_stages: Mechanisms it needs besides the planetary stage.
        obstacle: Why it cannot be built; empty if it can.
    """

    planetary: Planetary
    drive: str
    pulley_ratio: float
    area: float
    extra_stages: int
    obstacle: str = ""


def designs(gear_ratios: tuple[float, ...] = GEAR_RATIOS) -> list[Design]:
    """Return all combinations of Table 1's steps, 27 for three ratios of planet over sun diameter.

    The paper does not define compactness. Here the smallest gear and the smallest pulley have
    diameter 1, gears mesh, pulleys do not touch, and the area is that of the rectangle around them.
    A sun that is not fixed needs a stage that ties it to the carrier; driving the planet needs one
    that reaches its moving axis.
    """
    return [
        _design(Planetary(ratio, sun), drive)
        for ratio, sun, drive in itertools.product(gear_ratios, SUN_CONSTRAINTS, DRIVES)
    ]


def most_compact(candidates: list[Design]) -> Design:
    """Return the design of least area, and among equals the one of fewest extra stages.

    Raises:
        GrasperError: None of them can be built.
    """
    possible = [design for design in candidates if not design.obstacle]
    if not possible:
        raise GrasperError("None of the designs can be built.")
    return min(possible, key=lambda design: (round(design.area, 9), design.extra_stages))


def _design(planetary: Planetary, drive: str) -> Design:
    gears = _with_least_one(planetary.gear_ratio)
    pulleys = _with_least_one(planetary.decoupling_pulley_ratio)
    # the distance of the axes is the gears'; gears grow where pulleys would touch
    scale = max(1.0, sum(pulleys) / sum(gears))
    gears = (gears[0] * scale, gears[1] * scale)
    axes = sum(gears) / 2
    radii = [max(gear, pulley) / 2 for gear, pulley in zip(gears, pulleys, strict=True)]
    is_sun_fixed = planetary.sun_over_carrier == 0.0
    return Design(
        planetary=planetary,
        drive=drive,
        pulley_ratio=planetary.decoupling_pulley_ratio,
        area=(radii[0] + axes + radii[1]) * 2 * max(radii),
        extra_stages=int(not is_sun_fixed) + int(drive == "gear 2"),
        obstacle="the sun is fixed and cannot drive" if is_sun_fixed and drive == "gear 1" else "",
    )


def _with_least_one(ratio: float) -> tuple[float, float]:
    """Return two diameters of the given ratio, second over first, the smaller being 1."""
    return max(1.0, 1.0 / ratio), max(1.0, ratio)


def planetary_grasper(path: CablePath, planetary: Planetary = EQUAL_GEARS) -> Coupling:
    """Return the grasper with the planetary wrist, driven at the carrier.

    Both jaws' angles are measured in one sense about their common axis. Pitch is their mean. Grasp
    is the angle of jaw 1 less that of jaw 2; jaw 1 closes by turning in the positive sense. Motor
    angles are those of the motor's shaft.

    With d2/d1 = alpha/beta each motor moves its own joint. With another pulley ratio turning the
    yaw shortens the jaws' cables by equation 5, and both jaws, so the pitch, turn along.

    Raises:
        GrasperError: Pulleys overlap.
    """
    path.tangent_angles_rad()
    beta = 1.0 / planetary.alpha_over_beta  # for a carrier angle of one
    jaw_per_carrier = -path.shortening_m(1.0, beta) / (path.d3_m / 2)
    yaw, along = planetary.yaw_over_carrier / GEARHEAD_RATIO, jaw_per_carrier / GEARHEAD_RATIO
    jaw = DRUM_M / path.d3_m / GEARHEAD_RATIO
    jaws = np.array([[along, jaw, 0.0], [along, 0.0, jaw]])
    jacobian = np.vstack([[yaw, 0.0, 0.0], JAWS_TO_PITCH_AND_GRASP @ jaws])
    return Coupling("planetary grasper", JOINTS, jacobian)
