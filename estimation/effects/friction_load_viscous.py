"""Load-dependent viscous friction: viscous damping that grows with the load."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class LoadViscousFriction(Pointwise):
    """Viscous friction of a lubricant film under pressure.

    Equation: torque = c |load| speed, load in N m, speed in rad/s, c in s/rad.

    Check: run at several constant speeds at two loads; check the lubricant.

    Source: Bittencourt and Gunnarsson 2012 (load and speed together).
    """

    id = "friction.load_viscous"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "load": "motor_load_n_m"}
    amplitudes = (
        Parameter("damping", "target / load / speed", "damping per unit of load", lower=0.0),
    )
    told_apart_by = "a staircase of speeds at two loads"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        return (np.abs(inputs["load"]) * inputs["speed"],)
