"""Encoder non-linearity with harmonics: a periodic angle error with harmonics."""

from collections.abc import Mapping, Sequence
from typing import Any

from estimation.effects.effect import Parameter
from estimation.effects.harmonics import harmonics, harmonics_in
from estimation.effects.sensor_encoder_inl import EncoderNonlinearity


class EncoderHarmonics(EncoderNonlinearity):
    """An encoder whose periodic error is not a pure sine.

    Equation: error = sum over n = 1, 2, 3 of a_n sin(n order angle) + b_n cos(n order angle), a_n
    and b_n in rad, angle in rad, order in periods per turn.

    Check: turn slowly without load, and again with the other sensor turned by half a turn.

    Source: the harmonics caused by amplitude, offset and phase errors of the two tracks, as makers
    of magnetic angle encoders state them.
    """

    id = "sensor.encoder_inl.harmonics"
    family = "sensor.encoder_inl"
    amplitudes = harmonics_in("target")
    shape = (Parameter("order", "1", "periods per turn", 1.0, 16.0, linear=True, points=16),)

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return sine and cosine of each harmonic."""
        return harmonics(shape[0] * inputs["encoder"])
