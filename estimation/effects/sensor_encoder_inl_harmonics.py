"""Encoder error with harmonics: a wave over the turn that is not a pure sine."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class EncoderHarmonics(Pointwise):
    """An encoder whose wave is not a pure sine.

    Equation: error = sum over n = 1, 2, 3 of a_n sin(n order angle) + b_n cos(n order angle).

    Source: the harmonics that amplitude, offset and phase errors of the two tracks leave, as makers
    of magnetic angle encoders state them.
    """

    id = "sensor.encoder_inl.harmonics"
    family = "sensor.encoder_inl"
    balances: ClassVar = {"gearbox": 1, "stretch": 1}
    roles: ClassVar = {"encoder": "motor_angle_rad"}
    amplitudes = (
        Parameter("sine_1", "target", "amplitude of the sine"),
        Parameter("cosine_1", "target", "amplitude of the cosine"),
        Parameter("sine_2", "target", "the same at twice the order"),
        Parameter("cosine_2", "target", "the same at twice the order"),
        Parameter("sine_3", "target", "the same at three times the order"),
        Parameter("cosine_3", "target", "the same at three times the order"),
    )
    shape = (Parameter("order", "1", "periods a turn", 1.0, 16.0, linear=True, points=16),)
    confused_with = ("ripple.motor", "ripple.output", "coupling.kinematic", "eccentric.load")
    told_apart_by = "a slow sweep without load, and the same with the other sensor turned by half"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return sine and cosine of each harmonic."""
        phases = [n * shape[0] * inputs["encoder"] for n in (1, 2, 3)]
        return [wave(phase) for phase in phases for wave in (np.sin, np.cos)]
