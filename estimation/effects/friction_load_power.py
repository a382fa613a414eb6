"""Non-linear load-dependent friction: friction that grows with a power of the load."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise

UNIT_LOAD = 0.1
"""Reference load of the power law, N m: there the loss is mu times the load."""


class PowerLoadFriction(Pointwise):
    """Friction that is not proportional to the load: contacts that flatten, or teeth that seat.

    Equation: torque = mu L (|load| / L)^exponent tanh(speed / width), L = 0.1 N m, load in N m,
    width in rad/s, mu and exponent without unit.

    Check: repeat the same motion against three stiffnesses, and free.

    Source: Bowden and Tabor 1950 (friction as the area of contact: by Hertz's law the power 2/3 of
    the load for a single round contact, 1 for rough faces).
    """

    id = "friction.load.power"
    family = "friction.load"
    balances: ClassVar = {"motor": -1, "cable": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "load": "motor_load_n_m"}
    amplitudes = (
        Parameter("friction", "target / load", "loss per unit of load at 0.1 N m", lower=0.0),
    )
    shape = (
        Parameter("exponent", "1", "power of the load", 0.5, 2.5, points=5),
        Parameter("width", "speed", "speed at which the tanh reaches 76 %", 1e-3, 1e2),
    )
    told_apart_by = "the same motion against three stiffnesses, and free"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        pressed = UNIT_LOAD * (np.abs(inputs["load"]) / UNIT_LOAD) ** shape[0]
        return (pressed * np.tanh(inputs["speed"] / shape[1]),)
