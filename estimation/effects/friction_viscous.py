"""Viscous friction: friction proportional to speed."""

from typing import ClassVar

from estimation.effects.effect import LOSS, Parameter, Proportional


class ViscousFriction(Proportional):
    """Viscous friction of grease and bearings.

    Equation: torque = b speed, speed in rad/s, b in N m s/rad.

    Check: run at several constant speeds in both directions; check amount and temperature of the
    grease.

    Source: the classic friction model; Armstrong-Helouvry, Dupont and Canudas de Wit 1994.
    """

    id = "friction.viscous"
    balances = LOSS
    roles: ClassVar = {"speed": "motor_velocity_rad_s"}
    amplitudes = (Parameter("damping", "target / speed", "loss per unit of speed", lower=0.0),)
    told_apart_by = "a staircase of constant speeds in both directions"
