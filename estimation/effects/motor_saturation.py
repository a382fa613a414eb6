"""Magnetic saturation: a torque constant that falls at large currents."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class Saturation(Pointwise):
    """Saturation of the magnetic circuit: torque = K knee tanh(current / knee).

    Equation: loss = K (current - knee tanh(current / knee)), K in N m/A, current and knee in A.

    Check: measure the stall torque at several currents of both signs.

    Source: the saturating magnetisation curve of any iron circuit, by a hyperbolic tangent.
    """

    id = "motor.saturation"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"current": "motor_current_a"}
    amplitudes = (
        Parameter("gain", "target / current", "torque constant at small currents", lower=0.0),
    )
    shape = (Parameter("knee", "current", "current at which it saturates", 0.05, 5.0),)
    told_apart_by = "stall at several currents of both signs"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        return (inputs["current"] - shape[0] * np.tanh(inputs["current"] / shape[0]),)
