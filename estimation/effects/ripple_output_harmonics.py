"""Output ripple with harmonics: a wave over the turn that is not a pure sine."""

from collections.abc import Mapping, Sequence
from typing import Any

from estimation.effects.effect import Parameter
from estimation.effects.harmonics import HARMONIC_AMPLITUDES, harmonics
from estimation.effects.ripple_output import OutputRipple


class OutputHarmonics(OutputRipple):
    """A wave over the output's turn that is not a pure sine, such as the passing of a tooth.

    Equation: torque or angle = sum over n = 1, 2, 3 of a_n sin(n order angle) + b_n cos(n order
    angle).

    Source: harmonics of the meshing frequency; Randall 2011, "Vibration-based Condition
    Monitoring", section 2.2.
    """

    id = "ripple.output.harmonics"
    family = "ripple.output"
    amplitudes = HARMONIC_AMPLITUDES
    # a spindle turns by a third: two orders nearer than 0.5 are the same wave to it
    shape = (Parameter("order", "1", "periods a turn", 1.0, 16.0, linear=True, points=31),)

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return sine and cosine of each harmonic."""
        return harmonics(shape[0] * inputs["output_angle"])
