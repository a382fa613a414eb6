"""Encoder error with harmonics: a wave over the turn that is not a pure sine."""

from collections.abc import Mapping, Sequence
from typing import Any

from estimation.effects.effect import Parameter
from estimation.effects.harmonics import HARMONIC_AMPLITUDES, harmonics
from estimation.effects.sensor_encoder_inl import EncoderNonlinearity


class EncoderHarmonics(EncoderNonlinearity):
    """An encoder whose wave is not a pure sine.

    Equation: error = sum over n = 1, 2, 3 of a_n sin(n order angle) + b_n cos(n order angle).

    Source: the harmonics that amplitude, offset and phase errors of the two tracks leave, as makers
    of magnetic angle encoders state them.
    """

    id = "sensor.encoder_inl.harmonics"
    family = "sensor.encoder_inl"
    amplitudes = HARMONIC_AMPLITUDES
    shape = (Parameter("order", "1", "periods a turn", 1.0, 16.0, linear=True, points=16),)

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return sine and cosine of each harmonic."""
        return harmonics(shape[0] * inputs["encoder"])
