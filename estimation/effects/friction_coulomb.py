"""Coulomb friction: a constant torque against the direction of motion."""

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from estimation.effects.effect import LOSS, Effect, Parameter
from estimation.recording import FloatArray


class CoulombFriction(Effect):
    """Coulomb friction with a smooth change of sign.

    Equation: torque = F tanh(speed / width), F in N m, width in rad/s. The width is fitted too: the
    filter smooths a reversal, and a wrong width looks like Stribeck friction.

    Check: move slowly in both directions without load; the torque differs by 2 F at any speed.

    Source: the classic friction model; Armstrong-Helouvry, Dupont and Canudas de Wit 1994.
    """

    id = "friction.coulomb"
    balances = LOSS
    roles: ClassVar = {"speed": "motor_velocity_rad_s"}
    amplitudes = (Parameter("friction", "target", "loss in steady motion", lower=0.0),)
    shape = (Parameter("width", "speed", "speed at which the tanh reaches 76 %", 1e-3, 1e2),)
    told_apart_by = "a staircase of slow speeds around zero with long plateaus"

    def columns(self, inputs: Mapping[str, FloatArray], shape: Sequence[float]) -> FloatArray:
        """Return the smooth sign of the speed, shape (n, 1)."""
        return np.tanh(inputs["speed"] / shape[0])[:, None]

    def step(
        self, inputs: Mapping[str, float], shape: Sequence[float], state: list[float]
    ) -> Sequence[float]:
        """Return the smooth sign of the speed."""
        return (math.tanh(inputs["speed"] / shape[0]),)
