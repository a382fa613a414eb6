"""Quadratic drag: friction proportional to the square of speed."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Pointwise, Row, Shape


class Drag(Pointwise):
    """Quadratic drag of churned grease or of air.

    Equation: torque = c speed |speed|, speed in rad/s, c in N m s^2/rad^2.

    Check: run at several constant speeds up to the highest; check the amount and type of grease.

    Source: Armstrong-Helouvry, Dupont and Canudas de Wit 1994.
    """

    id = "friction.drag"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s"}
    amplitudes = (Parameter("drag", "target / speed / speed", "loss at one rad/s", lower=0.0),)
    told_apart_by = "a staircase of constant speeds up to the highest"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["speed"] * np.abs(inputs["speed"]),)
