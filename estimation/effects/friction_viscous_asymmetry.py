"""Viscous asymmetry: viscous damping that differs between the two directions."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Pointwise, Row, Shape


class ViscousAsymmetry(Pointwise):
    """The part of viscous friction that does not change its sign with the direction of motion.

    Equation: torque = b |speed|, speed in rad/s, b in N m s/rad: half the damping at positive
    speeds minus half that at negative ones.

    Check: run at several constant speeds in both directions.

    Source: Armstrong-Helouvry, Dupont and Canudas de Wit 1994.
    """

    id = "friction.viscous_asymmetry"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s"}
    amplitudes = (
        Parameter("asymmetry", "target / speed", "half the damping at speed > 0 less at speed < 0"),
    )
    told_apart_by = "a staircase of constant speeds in both directions"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (np.abs(inputs["speed"]),)
