"""Load-dependent friction: friction proportional to the load."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class LoadFriction(Pointwise):
    """Friction of teeth or of a wrapped cable that grows with the transmitted load.

    Equation: torque = mu |load| tanh(speed / width), load in N m, width in rad/s, mu without unit.

    Check: repeat the same motion with a soft and a stiff object, and free; inspect teeth and cable
    guides.

    Source: Bittencourt and Gunnarsson 2012 (static friction of a robot joint with load).
    """

    id = "friction.load"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "load": "motor_load_n_m"}
    amplitudes = (Parameter("friction", "target / load", "loss per unit of load", lower=0.0),)
    shape = (Parameter("width", "speed", "speed at which the tanh reaches 76 %", 1e-3, 1e2),)
    told_apart_by = "the same motion against two stiffnesses, and free"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        return (np.abs(inputs["load"]) * np.tanh(inputs["speed"] / shape[0]),)
