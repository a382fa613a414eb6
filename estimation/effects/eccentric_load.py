"""Eccentricity: a lever arm that varies over a turn, so that the load causes a periodic torque."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class EccentricLoad(Pointwise):
    """A pulley or a gear that is off centre. The order need not be an integer.

    Equation: torque = load (a sin(order angle) + b cos(order angle)), load in N m, angle in rad, a
    and b without unit, order in periods per turn.

    Check: measure the runout of pulleys and gears with a dial gauge.

    Source: the moment of a force about an axis: a lever arm r + e cos(angle) in place of r.
    """

    id = "eccentric.load"
    balances: ClassVar = {"motor": -1, "gearbox": 1, "cable": 1, "stretch": 1, "grasp": -1}
    roles: ClassVar = {"output_angle": "spindle_angle_rad", "load": "motor_load_n_m"}
    amplitudes: ClassVar[tuple[Parameter, ...]] = (
        Parameter("sine", "target / load", "eccentricity along one axis, of the lever arm"),
        Parameter("cosine", "target / load", "eccentricity along the other"),
    )
    shape = (Parameter("order", "1", "periods per turn", 0.5, 16.5, linear=True, points=33),)
    told_apart_by = "the same sweep against two loads"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return sine and cosine, times the load."""
        phase = shape[0] * inputs["output_angle"]
        return inputs["load"] * np.sin(phase), inputs["load"] * np.cos(phase)
