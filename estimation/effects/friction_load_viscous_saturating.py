"""Saturating load-viscous friction: damping that grows with load and falls with speed."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class SaturatingLoadViscousFriction(Pointwise):
    """Viscous friction of a loaded film whose viscosity falls with the shear rate.

    Equation: torque = c |load| speed / (1 + |speed| / knee), load in N m, speed and knee in rad/s,
    c in s/rad.

    Check: run at several constant speeds at two loads; check the lubricant.

    Source: Bair and Winer 1979 (a lubricant under pressure bears a limiting shear stress).
    """

    id = "friction.load_viscous.saturating"
    family = "friction.load_viscous"
    balances: ClassVar = {"motor": -1, "cable": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "load": "motor_load_n_m"}
    amplitudes = (
        Parameter("damping", "target / load / speed", "damping per unit of load", lower=0.0),
    )
    shape = (Parameter("knee", "speed", "speed at which half remains", 0.1, 500.0, points=9),)
    told_apart_by = "a staircase of speeds at two loads"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        speed = inputs["speed"]
        return (np.abs(inputs["load"]) * speed / (1.0 + np.abs(speed) / shape[0]),)
