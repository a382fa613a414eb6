"""End stop: a spring that is met beyond some angle."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class EndStop(Pointwise):
    """A stop, a fold of a hose or an object met on closing.

    Where it is met lies near one end of the travel: a stop that is never left is a spring.

    Equation: torque = k max(angle - onset, 0).

    Source: Hooke's law with a contact that does not pull.
    """

    id = "spring.end_stop"
    balances: ClassVar = {"cable": 1, "stretch": -1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"stop": "jaw_angle_rad"}
    amplitudes = (Parameter("stiffness", "target / stop", "torque a radian beyond", lower=0.0),)
    shape = (Parameter("onset", "stop", "angle at which it is met", -0.7, 2.5, True, 41),)
    confused_with = ("spring.position", "gravity.payload", "transmission.stiffening")
    told_apart_by = "a slow free sweep to the ends of the travel, in both directions"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        return (np.maximum(inputs["stop"] - shape[0], 0.0),)
