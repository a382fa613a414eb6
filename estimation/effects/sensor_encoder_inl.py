"""Encoder non-linearity: an angle reading with an error periodic in the angle."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class EncoderNonlinearity(Pointwise):
    """A periodic error of an encoder over its turn.

    Its causes are eccentricity (order 1), a tilted magnet (2), or unequal phases (4, or the number
    of lines).

    Equation: error = a sin(order angle) + b cos(order angle), a and b in rad, angle in rad, order
    in periods per turn. It is a candidate in the equations of angles only: the motor's or the
    spindle's encoder in the gearbox's, the spindle's or the jaw's in the stretch's. The jaw's
    encoder is the target there, and enough harmonics of an angle can represent the angle itself, so
    its error is computed over the prediction of that angle from spindle and load.

    Check: turn slowly without load, and again with the other sensor turned by half a turn; check
    the encoder's mount.

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
    shape = (Parameter("order", "1", "periods per turn", 1.0, 32.0, linear=True, points=32),)
    told_apart_by = (
        "a slow sweep without load, repeated with the other sensor turned by half a turn"
    )

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return sine and cosine."""
        phase = shape[0] * inputs["encoder"]
        return np.sin(phase), np.cos(phase)
