"""Magnetic saturation: a torque constant that falls at large currents."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Parameters, Pointwise, Row, Shape


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
    shape: ClassVar[Parameters] = (
        Parameter("knee", "current", "current at which it saturates", 0.05, 5.0),
    )
    told_apart_by = "stall at several currents of both signs"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["current"] - shape[0] * np.tanh(inputs["current"] / shape[0]),)


class CubicSaturation(Saturation):
    """The first term by which a saturating magnetic circuit loses torque.

    Equation: loss = c current^3.

    Source: the first odd term of any symmetric saturation curve.
    """

    id = "motor.saturation.cubic"
    meaning = "a torque constant that falls with the square of the current"
    amplitudes = (
        Parameter(
            "loss", "target / current / current / current", "loss for one cubic unit", lower=0.0
        ),
    )
    shape = ()

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["current"] ** 3,)
