"""Kinematic coupling: another joint's angle moves this one."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class KinematicCoupling(Proportional):
    """A cable that runs over another joint is pulled when that joint turns.

    Equation: angle = c other angle; on a joint whose cable is a spring, torque = c other angle.

    Source: the coupling matrices of cable-driven wrists (Kazanzides et al. 2014, the da Vinci
    Research Kit's actuator-to-joint matrix).
    """

    id = "coupling.kinematic"
    balances: ClassVar = {"stretch": 1, "grasp": 1, "pitch": 1, "yaw": 1, "joint": 1}
    roles: ClassVar = {"other_angle": "wrist_pitch_rad"}
    amplitudes = (
        Parameter("ratio", "target / other_angle", "what one radian there moves or pulls"),
    )
    confused_with = ("spring.position", "sensor.encoder_inl")
    told_apart_by = "the other joint moved alone"
