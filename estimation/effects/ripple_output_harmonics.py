"""Output ripple with harmonics: torque or angle that is periodic in the output angle."""

from collections.abc import Mapping, Sequence
from typing import Any

from estimation.effects.effect import Parameter
from estimation.effects.harmonics import harmonics, harmonics_in
from estimation.effects.ripple_output import OutputRipple


class OutputHarmonics(OutputRipple):
    """A periodic error over the output's turn that is not a pure sine, such as tooth meshing.

    Equation: torque or angle = sum over n = 1, 2, 3 of a_n sin(n order angle) + b_n cos(n order
    angle), a_n and b_n in the target's unit (N m or rad), angle in rad, order in periods per turn.

    Check: compare the order with the number of teeth; inspect the last gear stage.

    Source: harmonics of the meshing frequency; Randall 2011, "Vibration-based Condition
    Monitoring", section 2.2.
    """

    id = "ripple.output.harmonics"
    family = "ripple.output"
    amplitudes = harmonics_in("target")
    # the spindle turns by a third of a turn: orders closer than 0.5 are indistinguishable
    shape = (Parameter("order", "1", "periods per turn", 1.0, 16.0, linear=True, points=31),)

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return sine and cosine of each harmonic."""
        return harmonics(shape[0] * inputs["output_angle"])
