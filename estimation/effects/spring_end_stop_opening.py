"""End stop of opening: a contact spring below a limit angle."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class OpenEndStop(Pointwise):
    """A stop or a fold of a hose that is contacted on opening.

    The contact is near one end of the travel: a stop that is always in contact is a spring.

    Equation: torque = k min(angle - onset, 0), angle and onset in rad, k in N m/rad.

    Check: move slowly by hand to the end of the travel and look for the contact.

    Source: Hooke's law with a contact that does not pull.
    """

    id = "spring.end_stop.opening"
    family = "spring.end_stop"
    balances: ClassVar = {"cable": 1, "stretch": -1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"stop": "jaw_angle_rad"}
    amplitudes = (Parameter("stiffness", "target / stop", "torque per radian beyond", lower=0.0),)
    shape = (Parameter("onset", "stop", "angle of first contact", -2.6, 0.6, True, 41),)
    told_apart_by = "a slow free sweep to the ends of the travel, in both directions"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        return (np.minimum(inputs["stop"] - shape[0], 0.0),)
