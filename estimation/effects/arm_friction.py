"""Arm friction: a loss of constant size against a joint's direction, filtered as the torque."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class ArmFriction(Proportional):
    """Coulomb friction of an arm's joint, its sign taken before the filter.

    Equation: torque = F direction. A filter and a sign do not commute: the direction is made from
    barely filtered motion and then filtered as the torque is (`estimation.arm.shared`).

    Source: G. A. Piqué's thesis, 2018, equation 2.5.
    """

    id = "arm.friction"
    roles: ClassVar = {"direction": "joint_1_direction_ratio"}
    amplitudes = (Parameter("friction", "target", "loss in steady motion", lower=0.0),)
    confused_with = ("friction.coulomb", "friction.stribeck", "hysteresis.presliding")
    told_apart_by = "a staircase of slow speeds around zero with long plateaus"
