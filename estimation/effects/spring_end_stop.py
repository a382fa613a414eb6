"""End stop: a contact spring beyond a limit angle."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Pointwise, Row, Shape


class EndStop(Pointwise):
    """A stop, a fold of a hose or an object that is contacted on closing.

    The contact is near one end of the travel: a stop that is always in contact is a spring.

    Equation: torque = k max(angle - onset, 0), angle and onset in rad, k in N m/rad.

    Check: move slowly by hand to the end of the travel and look for the contact.

    Source: Hooke's law with a contact that does not pull.
    """

    id = "spring.end_stop"
    meaning = "a contact spring above an upper limit of the travel"
    balances: ClassVar = {"cable": 1, "stretch": -1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"stop": "jaw_angle_rad"}
    amplitudes = (
        Parameter("stiffness", "target / stop", "torque or force per unit beyond", lower=0.0),
    )
    shape = (Parameter("onset", "stop", "angle of first contact", -0.7, 2.5, True, 41),)
    told_apart_by = "a slow free sweep to the ends of the travel, in both directions"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (np.maximum(inputs["stop"] - shape[0], 0.0),)


class OpenEndStop(EndStop):
    """A stop or a fold of a hose that is contacted on opening.

    The contact is near one end of the travel: a stop that is always in contact is a spring.

    Equation: torque = k min(angle - onset, 0), angle and onset in rad, k in N m/rad.

    Check: move slowly by hand to the end of the travel and look for the contact.

    Source: Hooke's law with a contact that does not pull.
    """

    id = "spring.end_stop.opening"
    meaning = "a contact spring below a lower limit of the travel"
    shape = (Parameter("onset", "stop", "angle of first contact", -2.6, 0.6, True, 41),)

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (np.minimum(inputs["stop"] - shape[0], 0.0),)
