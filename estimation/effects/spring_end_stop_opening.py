"""End stop of opening: a spring that is met below some angle."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class OpenEndStop(Pointwise):
    """A stop, or a fold of a hose, met on opening.

    Where it is met lies near one end of the travel: a stop that is never left is a spring.

    Equation: torque = k min(angle - onset, 0).

    Source: Hooke's law with a contact that does not pull.
    """

    id = "spring.end_stop.opening"
    family = "spring.end_stop"
    balances: ClassVar = {"cable": 1, "stretch": -1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"stop": "jaw_angle_rad"}
    amplitudes = (Parameter("stiffness", "target / stop", "torque a radian beyond", lower=0.0),)
    shape = (Parameter("onset", "stop", "angle at which it is met", -2.6, 0.6, True, 41),)
    confused_with = ("spring.position", "gravity.payload", "transmission.stiffening")
    told_apart_by = "a slow free sweep to the ends of the travel, in both directions"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        return (np.minimum(inputs["stop"] - shape[0], 0.0),)
