"""Load-dependent viscous friction: viscous damping that grows with the load."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Pointwise, Row, Shape


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

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (np.abs(inputs["load"]) * inputs["speed"],)


class SaturatingLoadViscousFriction(LoadViscousFriction):
    """Viscous friction of a loaded film whose viscosity falls with the shear rate.

    Equation: torque = c |load| speed / (1 + |speed| / knee), load in N m, speed and knee in rad/s,
    c in s/rad.

    Check: run at several constant speeds at two loads; check the lubricant.

    Source: Bair and Winer 1979 (a lubricant under pressure bears a limiting shear stress).
    """

    id = "friction.load_viscous.saturating"
    meaning = "viscous damping that grows with the load and falls with speed"
    balances: ClassVar = {"motor": -1, "cable": 1}
    shape = (Parameter("knee", "speed", "speed at which half remains", 0.1, 500.0, points=9),)

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        speed = inputs["speed"]
        return (np.abs(inputs["load"]) * speed / (1.0 + np.abs(speed) / shape[0]),)
