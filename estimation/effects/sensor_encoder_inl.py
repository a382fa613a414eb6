"""Encoder error: a reading of an angle that is wrong by a wave over its turn."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class EncoderNonlinearity(Pointwise):
    """An encoder off its centre (order 1), a tilted magnet (2), unequal phases (4, or its lines).

    Equation: error = a sin(order angle) + b cos(order angle). In the balances of angles only: the
    motor's or the spindle's encoder in the gearbox's, the spindle's or the jaw's in the stretch's.
    The jaw's own encoder is the target there, and the waves of an angle add up to the angle itself,
    so its error is taken over what spindle and load say of that angle.

    Source: integral non-linearity of magnetic angle encoders by harmonics of the turn, as their
    makers' data sheets give it.
    """

    id = "sensor.encoder_inl"
    balances: ClassVar = {"gearbox": 1, "stretch": 1}
    roles: ClassVar = {"encoder": "motor_angle_rad"}
    amplitudes: ClassVar[tuple[Parameter, ...]] = (
        Parameter("sine", "target", "amplitude of the sine"),
        Parameter("cosine", "target", "amplitude of the cosine"),
    )
    shape = (Parameter("order", "1", "periods a turn", 1.0, 32.0, linear=True, points=32),)
    confused_with = ("ripple.motor", "ripple.output", "coupling.kinematic", "eccentric.load")
    told_apart_by = "a slow sweep without load, and the same with the other sensor turned by half"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return sine and cosine."""
        phase = shape[0] * inputs["encoder"]
        return np.sin(phase), np.cos(phase)
