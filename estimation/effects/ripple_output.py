"""Output ripple: what repeats with the turn of the output, behind the gearhead."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class OutputRipple(Pointwise):
    """A wave over the spindle's turn: a bent shaft, teeth of the last stage, a notched pulley.

    Equation: torque or angle = a sin(order angle) + b cos(order angle). The order need not be
    whole. It stays below the gear ratio: a wave that comes once a turn of the motor, or several
    times, is the motor's.

    Source: order tracking of rotating machines; Randall 2011, "Vibration-based Condition
    Monitoring", section 3.6.
    """

    id = "ripple.output"
    balances: ClassVar = {
        "motor": -1,
        "gearbox": 1,
        "cable": 1,
        "stretch": 1,
        "grasp": -1,
        "joint": 1,
    }
    roles: ClassVar = {"output_angle": "spindle_angle_rad"}
    amplitudes: ClassVar[tuple[Parameter, ...]] = (
        Parameter("sine", "target", "amplitude of the sine"),
        Parameter("cosine", "target", "amplitude of the cosine"),
    )
    # a spindle turns by a third: two orders nearer than 0.5 are the same wave to it
    shape = (Parameter("order", "1", "periods a turn", 1.0, 32.0, linear=True, points=63),)
    confused_with = (
        "ripple.motor",
        "sensor.encoder_inl",
        "eccentric.load",
        "coupling.kinematic",
        "spring.position",
        "gravity.payload",
    )
    told_apart_by = "a sweep at a slow constant speed over several turns, and under another load"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return sine and cosine."""
        phase = shape[0] * inputs["output_angle"]
        return np.sin(phase), np.cos(phase)
