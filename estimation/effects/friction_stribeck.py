"""Stribeck friction: friction that is larger at low speed."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Pointwise, Row, Shape


class Stribeck(Pointwise):
    """The part of friction that decreases with speed as a film of lubricant builds up.

    Equation: torque = F exp(-(speed / fall)^2) tanh(speed / width), F in N m, fall and width in
    rad/s.

    Check: run at several slow constant speeds around zero; check the lubricant.

    Source: Armstrong-Helouvry, Dupont and Canudas de Wit 1994.
    """

    id = "friction.stribeck"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s"}
    amplitudes = (
        Parameter("friction", "target", "loss at low speed minus that at speed", lower=0.0),
    )
    shape = (
        Parameter("fall", "speed", "speed at which 37 % remains", 1e-2, 1e2),
        Parameter("width", "speed", "speed at which friction reaches 76 %", 1e-3, 1e2),
    )
    told_apart_by = "a staircase of slow speeds around zero with long plateaus"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (np.exp(-((inputs["speed"] / shape[0]) ** 2)) * np.tanh(inputs["speed"] / shape[1]),)
