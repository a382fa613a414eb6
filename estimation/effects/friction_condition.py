"""Condition friction: friction that follows a stated condition of the runs."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Pointwise, Row, Shape


class ConditionFriction(Pointwise):
    """Friction that differs between runs as one of their stated conditions does.

    Equation: torque = a condition tanh(speed / width), in addition to Coulomb friction. a in N m
    per unit of the condition, width in rad/s.

    Check: repeat one run at other values of the condition, all other conditions equal.

    Source: Bittencourt, Wernholt, Sander-Tavallaey and Brogardh 2010 (friction of a robot joint as
    a function of its load), to first order in the condition.
    """

    id = "friction.condition"
    meaning = "friction that follows a stated condition of the runs"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "condition": "payload_kg"}
    amplitudes = (Parameter("slope", "target / condition", "loss per unit of the condition"),)
    shape: ClassVar[tuple[Parameter, ...]] = (
        Parameter("width", "speed", "speed at which friction reaches 76 %", 1e-2, 50.0, points=6),
    )
    told_apart_by = "one run at several values of the condition, all others equal"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["condition"] * np.tanh(inputs["speed"] / shape[0]),)


class ViscousConditionFriction(ConditionFriction):
    """Viscous friction that differs between runs as one of their stated conditions does.

    Equation: torque = a condition speed, in addition to viscous friction. a in N m s/rad per unit
    of the condition.

    Check: repeat one run at other values of the condition, all other conditions equal.

    Source: Bittencourt, Wernholt, Sander-Tavallaey and Brogardh 2010 (friction of a robot joint as
    a function of its load), to first order in the condition.
    """

    id = "friction.condition.viscous"
    meaning = "viscous friction that follows a stated condition of the runs"
    family = "friction.condition"
    amplitudes = (
        Parameter("slope", "target / speed / condition", "damping per unit of the condition"),
    )
    shape = ()

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["condition"] * inputs["speed"],)
