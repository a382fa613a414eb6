"""Kinematic coupling: motion of this joint by the angle of another joint."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


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
