"""Capstan friction: a cable wrapped on a surface passes on less than it is pulled with."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class Capstan(Pointwise):
    """Loss of a cable over a constant angle of wrap.

    Equation: torque = c load (exp(wrap tanh(speed / width)) - 1), wrap being the coefficient of
    friction times the angle. Pulling, the tension grows by exp(wrap); letting go, it falls by it.

    Source: the capstan equation of Euler and Eytelwein.
    """

    id = "friction.capstan"
    balances: ClassVar = {"cable": 1, "grasp": -1, "pitch": -1, "yaw": -1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "load": "distal_torque_n_m"}
    amplitudes = (Parameter("carried", "target / load", "share of the load carried", lower=0.0),)
    shape = (
        Parameter("wrap", "1", "coefficient of friction times angle of wrap", 0.03, 3.0, points=4),
        Parameter(
            "width", "speed", "speed at which 76 % of the direction is there", 1e-2, 50.0, points=6
        ),
    )
    confused_with = ("friction.load", "friction.position")
    same_as = ("friction.load",)  # what its two directions differ by is within the ratio
    bends = ("load",)
    told_apart_by = "the same motion at another angle of wrap, such as another pose of the wrist"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        return (inputs["load"] * np.expm1(shape[0] * np.tanh(inputs["speed"] / shape[1])),)
