"""Coulomb asymmetry: Coulomb friction that differs between the two directions."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Pointwise, Row, Shape


class CoulombAsymmetry(Pointwise):
    """The part of Coulomb friction that does not change its sign with the direction of motion.

    Equation: torque = F |tanh(speed / width)|, F in N m, width in rad/s. F is half the friction at
    positive speeds minus half that at negative ones.

    Check: compare slow motion in both directions with the torque at standstill.

    Source: Armstrong-Helouvry, Dupont and Canudas de Wit 1994.
    """

    id = "friction.coulomb_asymmetry"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s"}
    amplitudes = (Parameter("asymmetry", "target", "half the loss at speed > 0 less at speed < 0"),)
    shape = (Parameter("width", "speed", "speed at which friction reaches 76 %", 1e-3, 1e2),)
    told_apart_by = "standstill periods, and slow motion in both directions"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (np.abs(np.tanh(inputs["speed"] / shape[0])),)
