"""Position-dependent friction: friction that varies along the travel."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class PositionFriction(Pointwise):
    """Friction of a track, a hose or a cable that is larger at some positions than at others.

    Equation: torque = (a position + b position^2 + c position^3) tanh(speed / width), in addition
    to Coulomb friction. position in rad, width in rad/s, a in N m/rad, b in N m/rad^2, c in
    N m/rad^3.

    Check: move slowly over the whole travel without load in both directions, and inspect the places
    of large friction.

    Source: Popovic and Goldenberg 1998 (friction of a drive as a function of its position).
    """

    id = "friction.position"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "position": "spindle_angle_rad"}
    amplitudes = (
        Parameter("slope", "target / position", "linear change with position"),
        Parameter("bend", "target / position / position", "quadratic change with position"),
        Parameter("twist", "target / position / position / position", "cubic change with position"),
    )
    shape = (Parameter("width", "speed", "speed at which the tanh reaches 76 %", 1e-3, 1e2),)
    told_apart_by = "a slow sweep without load, in both directions"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        along = inputs["position"] * np.tanh(inputs["speed"] / shape[0])
        square = inputs["position"] * along
        return along, square, inputs["position"] * square
