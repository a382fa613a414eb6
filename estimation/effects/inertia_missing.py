"""Inertia: torque that accelerates the moving parts."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class Inertia(Proportional):
    """Inertia of the rotor, the gearhead or the jaw.

    Equation: torque = J acceleration, acceleration in rad/s^2, J in kg m^2.

    Check: repeat the motion at twice the frequency; compare J with the data sheets of motor and
    gear.

    Source: Newton's second law; the equation of motion of any servo joint.
    """

    id = "inertia.missing"
    balances: ClassVar = {"motor": -1, "gearbox": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"acceleration": "motor_acceleration_rad_s2"}
    amplitudes = (
        Parameter("inertia", "target / acceleration", "mass or moment of inertia", lower=0.0),
    )
    told_apart_by = "the same motion at twice the frequency"
