"""Arm friction: Coulomb friction of an arm's joint, filtered like the measured torque."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class ArmFriction(Proportional):
    """Coulomb friction of an arm's joint, its sign taken before the filter.

    Equation: torque = F direction, F in N m (N for a prismatic joint). A filter and the sign
    function do not commute, so the direction (-1 to 1) is computed from barely filtered motion and
    then filtered like the torque (`estimation.arm.shared`).

    Check: turn the joint slowly in both directions; the torque differs by 2 F at any speed.

    Source: G. A. Piqué's thesis, 2018, equation 2.5.
    """

    id = "arm.friction"
    roles: ClassVar = {"direction": "joint_1_direction_ratio"}
    amplitudes = (Parameter("friction", "target", "size of friction at any speed", lower=0.0),)
    told_apart_by = "a staircase of slow speeds around zero with long plateaus"
