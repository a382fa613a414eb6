"""Position friction: a loss that varies along the travel."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class PositionFriction(Pointwise):
    """Friction of a track, a hose or a cable that rubs more in one place than in another.

    Equation: torque = (a position + b position^2 + c position^3) tanh(speed / width), beside
    Coulomb friction.

    Source: Popovic and Goldenberg 1998 (friction of a drive as a function of its position).
    """

    id = "friction.position"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "position": "spindle_angle_rad"}
    amplitudes = (
        Parameter("slope", "target / position", "loss that comes with one radian"),
        Parameter("bend", "target / position / position", "loss with the radian's square"),
        Parameter("twist", "target / position / position / position", "loss with its cube"),
    )
    shape = (
        Parameter("width", "speed", "speed at which 76 % of the direction is there", 1e-3, 1e2),
    )
    confused_with = ("friction.load", "friction.capstan", "spring.position")
    bends = ("position",)
    told_apart_by = "a slow sweep without load, in both directions"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        along = inputs["position"] * np.tanh(inputs["speed"] / shape[0])
        square = inputs["position"] * along
        return along, square, inputs["position"] * square
