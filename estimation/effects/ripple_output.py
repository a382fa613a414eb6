"""Output ripple: torque or angle that is periodic in the output angle, after the gearhead."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class OutputRipple(Pointwise):
    """A periodic error over the spindle's turn: bent shaft, gear teeth or notched pulley.

    Equation: torque or angle = a sin(order angle) + b cos(order angle), a and b in the target's
    unit (N m or rad), angle in rad, order in periods per turn. The order need not be an integer. It
    is below the gear ratio: a period of one motor turn or less belongs to the motor.

    Check: measure the runout of the output shaft and pulley; inspect the last gear stage.

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
    # the spindle turns by a third of a turn: orders closer than 0.5 are indistinguishable
    shape = (Parameter("order", "1", "periods per turn", 1.0, 32.0, linear=True, points=63),)
    told_apart_by = "a sweep at a slow constant speed over several turns, and under another load"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return sine and cosine."""
        phase = shape[0] * inputs["output_angle"]
        return np.sin(phase), np.cos(phase)
