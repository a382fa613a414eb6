"""Payload: the weight of what hangs on the joint."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class Payload(Pointwise):
    """A mass off the axis of rotation, the axis being level.

    Equation: torque = m g l (a sin(tilt) + b cos(tilt)).

    Source: Newton's law of gravitation near the ground; the gravity term of any manipulator.
    """

    id = "gravity.payload"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"tilt": "jaw_angle_rad"}
    amplitudes = (
        Parameter("sine", "target", "torque with the sine of the angle"),
        Parameter("cosine", "target", "torque with its cosine"),
    )
    confused_with = ("spring.position", "sensor.offset")
    told_apart_by = "the same slow sweep with the rig tilted"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        return (
            np.sin(inputs["tilt"]),
            np.cos(inputs["tilt"]),
        )
