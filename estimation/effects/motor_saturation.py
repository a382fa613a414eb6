"""Saturation: torque that falls behind a large current."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class Saturation(Pointwise):
    """The magnetic circuit saturates: torque = K knee tanh(current / knee).

    Equation: loss = K (current - knee tanh(current / knee)).

    Source: the saturating magnetisation curve of any iron circuit, by a hyperbolic tangent.
    """

    id = "motor.saturation"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"current": "motor_current_a"}
    amplitudes = (
        Parameter("gain", "target / current", "torque constant at small currents", lower=0.0),
    )
    shape = (Parameter("knee", "current", "current at which the magnet saturates", 0.05, 5.0),)
    confused_with = ("sensor.gain_nonlinear", "friction.load")
    bends = ("current",)
    told_apart_by = "stall at several currents of both signs"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        return (inputs["current"] - shape[0] * np.tanh(inputs["current"] / shape[0]),)
