"""Coulomb friction: a constant torque against the direction of motion."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import LOSS, Inputs, Parameter, Pointwise, Row, Shape


class CoulombFriction(Pointwise):
    """Coulomb friction with a smooth change of sign.

    Equation: torque = F tanh(speed / width), F in N m, width in rad/s. The width is fitted too: the
    filter smooths a reversal, and a wrong width looks like Stribeck friction.

    Check: move slowly in both directions without load; the torque differs by 2 F at any speed.

    Source: the classic friction model; Armstrong-Helouvry, Dupont and Canudas de Wit 1994.
    """

    id = "friction.coulomb"
    balances = LOSS
    roles: ClassVar = {"speed": "motor_velocity_rad_s"}
    amplitudes = (Parameter("friction", "target", "size of friction at any speed", lower=0.0),)
    shape = (Parameter("width", "speed", "speed at which friction reaches 76 %", 1e-3, 1e2),)
    told_apart_by = "a staircase of slow speeds around zero with long plateaus"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (np.tanh(inputs["speed"] / shape[0]),)
