"""Payload: gravity torque of a mass on the joint."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Pointwise, Row, Shape


class Payload(Pointwise):
    """A mass at a distance from the axis of rotation, with a horizontal axis.

    Equation: torque = m g l (a sin(tilt) + b cos(tilt)), tilt in rad. The amplitudes are m g l a
    and m g l b in N m.

    Check: repeat a slow motion with the rig tilted; check for attached cables and tools.

    Source: Newton's law of gravitation near the ground; the gravity term of any manipulator.
    """

    id = "gravity.payload"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"tilt": "jaw_angle_rad"}
    amplitudes = (
        Parameter("sine", "target", "torque with the sine of the angle"),
        Parameter("cosine", "target", "torque with its cosine"),
    )
    told_apart_by = "the same slow sweep with the rig tilted"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (
            np.sin(inputs["tilt"]),
            np.cos(inputs["tilt"]),
        )
