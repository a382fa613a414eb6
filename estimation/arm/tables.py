"""Arms as data: modified Denavit-Hartenberg rows, joint limits, and what their joints carry.

A row places joint i on link i - 1 (Craig's convention):
T = RotX(alpha) TransX(a) RotZ(theta) TransZ(d), with q added to theta or, prismatic, to d.
"""

from dataclasses import dataclass, replace
from math import pi, radians
from typing import Literal

import numpy as np

from estimation.recording import FloatArray

Link = Literal["full", "first moments", "thin"]
"""All ten parameters; the first moments only, of a link whose mass is negligible; mass and first
moment along the own x axis only, of a thin bar."""


@dataclass(frozen=True, slots=True)
class DhRow:
    """One row of a modified Denavit-Hartenberg table: m and rad."""

    a_m: float  # distance along the previous x axis
    alpha_rad: float  # angle about the previous x axis
    d_m: float  # distance along the own z axis at q = 0
    theta_rad: float  # angle about the own z axis at q = 0


@dataclass(frozen=True, slots=True)
class Joint:
    """One joint of an arm. Limits are in rad and rad/s, or in m and m/s where prismatic."""

    name: str
    kind: Literal["revolute", "prismatic"]
    row: DhRow  # where it sits
    lower: float
    upper: float
    speed: float
    link: Link = "full"  # which of its link's ten parameters count, see `Link`
    spring: bool = False  # whether an elastic torque proportional to its position acts on it


@dataclass(frozen=True, slots=True)
class Body:
    """One body of an arm's spanning tree, on a joint along or about its z axis."""

    name: str
    parent: int  # number of the parent body, from 1; 0 is the base
    row: DhRow  # position of its joint on that body
    closure: tuple[float, ...]  # how far its joint moves with each actuated joint: its row of G
    prismatic: bool = False  # whether its joint slides
    link: Link = "full"  # as `Joint.link`
    label: str = ""  # what the names of its parameters end in; its number if empty


@dataclass(frozen=True, slots=True)
class PointMass:
    """A mass fixed to a link, in addition to the link's own parameters.

    Links are numbered from 1; the point is in the link's frame.
    """

    name: str
    link: int
    point_m: tuple[float, float, float]
    mass_kg: float


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool on the last link: its masses, and the row from the last joint's frame to its tip."""

    name: str
    tip: DhRow
    masses: tuple[PointMass, ...] = ()


@dataclass(frozen=True, slots=True)
class Arm:
    """An arm: its joints in a row, and the bodies of its loops where it has any."""

    name: str
    joints: tuple[Joint, ...]  # from the base to the tip
    tip: DhRow  # the fixed row from the last joint's frame to the tip's
    # pairs of joints (from 0) whose viscous friction is coupled: the torque of the first by the
    # speed of the second
    viscous_pairs: tuple[tuple[int, int], ...]
    gravity_m_s2: tuple[float, float, float]  # gravity in the base frame
    source: str  # source of the numbers
    wrist: int | None = None  # first joint (from 0) that cables drive from coupled motors, or None
    # M of q = M q_motor for the joints from `wrist` on, the gripper's last
    wrist_coupling: tuple[tuple[float, ...], ...] = ()
    # Spanning tree of all bodies, parents first, where loops make more bodies than joints; see
    # `bodies`. The torque of the joints is then the closure's transpose times the tree's (E. del
    # Sol et al. 2014, equations 8 to 13).
    loops: tuple[Body, ...] = ()
    tip_body: int = 0  # number of the body that the tip's row is on; 0 is the last joint's
    # whether cylinders drive it: every body of the loops rubs on its joint, and the torque, from
    # pressures, has a true zero
    hydraulic: bool = False
    # payloads and the masses of a tool; `estimation.arm.payload.carried_torque` returns their joint
    # torque
    carried: tuple[PointMass, ...] = ()

    def with_payload(self, *masses: PointMass) -> "Arm":
        """Return the arm with additional masses."""
        return replace(self, carried=(*self.carried, *masses))

    def with_tool(self, tool: Tool) -> "Arm":
        """Return the arm with a tool at its end: its tip is the tool's, and it carries the tool."""
        mounted = replace(self, name=f"{self.name}, with {tool.name}", tip=tool.tip)
        return mounted.with_payload(*tool.masses)

    @property
    def limits(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The joints' lower and upper ends and their speeds, shape (joints,) each."""
        table = np.array([(joint.lower, joint.upper, joint.speed) for joint in self.joints])
        lower, upper, speed = table.T.copy()
        return lower, upper, speed

    @property
    def closure(self) -> FloatArray:
        """G of q = G y: the bodies' joints by the actuated ones, shape (bodies, joints)."""
        return np.array([body.closure for body in self.bodies])

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The spanning tree: that of the loops, else one body a joint."""
        if self.loops:
            return self.loops
        count = len(self.joints)
        return tuple(
            Body(
                joint.name,
                k,
                joint.row,
                tuple(float(k == j) for j in range(count)),
                joint.kind == "prismatic",
                joint.link,
                str(k + 1),
            )
            for k, joint in enumerate(self.joints)
        )


def _turning(
    name: str, row: DhRow, reach_deg: float, speed: float, link: Link = "full", spring: bool = False
) -> Joint:
    """Return a revolute joint that turns as far to either side."""
    reach = radians(reach_deg)
    return Joint(name, "revolute", row, -reach, reach, speed, link, spring)


PSM = Arm(
    name="da Vinci patient-side manipulator, serial",
    joints=(
        _turning("outer yaw", DhRow(0.0, pi / 2, 0.0, pi / 2), 60, 2.0, spring=True),
        _turning("outer pitch", DhRow(0.0, -pi / 2, 0.0, -pi / 2), 45, 2.0, spring=True),
        Joint(
            "insertion", "prismatic", DhRow(0, pi / 2, -0.43, 0), lower=0.05, upper=0.18, speed=0.4
        ),
        _turning("outer roll", DhRow(0.0, 0.0, 0.41, 0.0), 180, 6.0, "first moments", spring=True),
        _turning("wrist pitch", DhRow(0.0, -pi / 2, 0.0, -pi / 2), 90, 5.0, "first moments"),
        _turning("wrist yaw", DhRow(0.0091, -pi / 2, 0.0, -pi / 2), 90, 5.0, "first moments"),
    ),
    tip=DhRow(0.0, -pi / 2, 0.01, 0.0),
    viscous_pairs=((4, 5), (5, 4)),
    gravity_m_s2=(0.0, 0.0, -9.80665),
    source="G. A. Piqué, Dynamic Modeling of the Da Vinci Research Kit Arm, 2018, tables 2.1, 2.3",
    wrist=4,
    wrist_coupling=((1.0186, 0.0, 0.0), (-0.8306, 0.6089, 0.6089), (0.0, -1.2177, 1.2177)),
)
"""The thesis' model: 68 parameters of links, springs, frictions, drives and offsets."""

_SERIAL = PSM.bodies

PSM_CLOSED = replace(
    PSM,
    name="da Vinci patient-side manipulator, closed chain",
    loops=(
        *_SERIAL,
        Body(
            name="parallelogram bar",
            parent=2,
            row=DhRow(-0.15, 0.0, 0.0, 0.0),
            closure=(0.0, -1.0, 0.0, 0.0, 0.0, 0.0),
            link="thin",
            label="b",
        ),
        Body(
            name="counterweight",
            parent=2,
            row=DhRow(-0.3, pi / 2, 0.0, 0.0),
            closure=(0.0, 0.0, -1.0, 0.0, 0.0, 0.0),
            prismatic=True,
            label="c",
        ),
    ),
    source=(
        "as the serial model; the parallelogram's bar, thin and along the yaw axis, keeps its"
        " direction as joint 2 turns; the counterweight slides against the insertion; where both"
        " sit on link 2 is assumed"
    ),
)
"""The real arm's loops on top of the thesis' model."""
