"""Load friction: a loss in proportion to the load."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class LoadFriction(Pointwise):
    """Friction of teeth or of a wrapped cable that grows with what they carry.

    Equation: torque = mu |load| tanh(speed / width).

    Source: Bittencourt and Gunnarsson 2012 (static friction of a robot joint with load).
    """

    id = "friction.load"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "load": "motor_load_n_m"}
    amplitudes = (Parameter("friction", "target / load", "loss for one unit of load", lower=0.0),)
    shape = (
        Parameter("width", "speed", "speed at which 76 % of the direction is there", 1e-3, 1e2),
    )
    confused_with = ("friction.position", "friction.capstan", "friction.load_viscous")
    same_as = ("friction.capstan",)
    bends = ("load",)
    told_apart_by = "the same motion against two stiffnesses, and free"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        return (np.abs(inputs["load"]) * np.tanh(inputs["speed"] / shape[0]),)
