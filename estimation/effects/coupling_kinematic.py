"""Kinematic coupling: motion of this joint by the angle of another joint."""

from typing import ClassVar

from estimation.effects.effect import Inputs, Parameter, Pointwise, Proportional, Row, Shape


class KinematicCoupling(Proportional):
    """A cable that runs over another joint is pulled when that joint turns.

    Equation: angle = c other angle, c in rad/rad. For a joint whose cable is a spring, torque = c
    other angle, c in N m/rad.

    Check: move the other joint alone and observe this one; check the pulley diameters.

    Source: the coupling matrices of cable-driven wrists (Kazanzides et al. 2014, the da Vinci
    Research Kit's actuator-to-joint matrix).
    """

    id = "coupling.kinematic"
    balances: ClassVar = {"stretch": 1, "grasp": 1, "pitch": 1, "yaw": 1, "joint": 1}
    roles: ClassVar = {"other_angle": "wrist_pitch_rad"}
    amplitudes = (
        Parameter("ratio", "target / other_angle", "angle or torque per radian of the other"),
    )
    told_apart_by = "the other joint moved alone"


class BowedCoupling(Pointwise):
    """A cable that passes another joint at a distance from its axis.

    Its path length is not linear in that joint's angle.

    Equation: angle = c other angle + d other angle^2, c in rad/rad, d in rad/rad^2: the path length
    to second order.

    Check: move the other joint alone over its whole range and plot this joint's angle.

    Source: the path lengths of cables over pulleys whose centres move, Zhao and Nelson 2016,
    equations 1 to 5, expanded about the straight pose.
    """

    id = "coupling.kinematic.bowed"
    meaning = "motion of this joint by the angle of another joint, not in proportion"
    family = "coupling.kinematic"
    balances: ClassVar = {"stretch": 1}
    roles: ClassVar = {"other_angle": "wrist_pitch_rad"}
    amplitudes = (
        Parameter("ratio", "target / other_angle", "angle per radian of the other joint"),
        Parameter("bow", "target / other_angle / other_angle", "angle per radian squared of it"),
    )
    told_apart_by = "the other joint moved alone"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        angle = inputs["other_angle"]
        return angle, angle * angle
