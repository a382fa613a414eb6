"""Gain by side: a drive that gives more in one direction than in the other."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Pointwise, Row, Shape


class GainBySide(Pointwise):
    """A gain of its own to either side.

    Causes are a cylinder with a rod on one side, a valve, or a bridge with unequal branches.

    Equation: torque = a |current|, current in A, a in N m/A: half the gain of closing minus that of
    opening.

    Check: measure the stall torque at the same current of both signs.

    Source: a separate constant for either side, as the two areas of a cylinder give.
    """

    id = "motor.gain_by_side"
    balances: ClassVar = {"grasp": -1}
    roles: ClassVar = {"current": "motor_current_a"}
    amplitudes = (
        Parameter("asymmetry", "target / current", "half the gain of current > 0 less current < 0"),
    )
    told_apart_by = "stall at the same current of both signs"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (np.abs(inputs["current"]),)
