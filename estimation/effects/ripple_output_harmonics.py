"""Output ripple with harmonics: a wave over the turn that is not a pure sine."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class OutputHarmonics(Pointwise):
    """A wave over the output's turn that is not a pure sine, such as the passing of a tooth.

    Equation: torque or angle = sum over n = 1, 2, 3 of a_n sin(n order angle) + b_n cos(n order
    angle).

    Source: harmonics of the meshing frequency; Randall 2011, "Vibration-based Condition
    Monitoring", section 2.2.
    """

    id = "ripple.output.harmonics"
    family = "ripple.output"
    balances: ClassVar = {
        "motor": -1,
        "gearbox": 1,
        "cable": 1,
        "stretch": 1,
        "grasp": -1,
        "joint": 1,
    }
    roles: ClassVar = {"output_angle": "spindle_angle_rad"}
    amplitudes = (
        Parameter("sine_1", "target", "amplitude of the sine"),
        Parameter("cosine_1", "target", "amplitude of the cosine"),
        Parameter("sine_2", "target", "the same at twice the order"),
        Parameter("cosine_2", "target", "the same at twice the order"),
        Parameter("sine_3", "target", "the same at three times the order"),
        Parameter("cosine_3", "target", "the same at three times the order"),
    )
    # a spindle turns by a third: two orders nearer than 0.5 are the same wave to it
    shape = (Parameter("order", "1", "periods a turn", 1.0, 16.0, linear=True, points=31),)
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
        """Return sine and cosine of each harmonic."""
        phases = [n * shape[0] * inputs["output_angle"] for n in (1, 2, 3)]
        return [wave(phase) for phase in phases for wave in (np.sin, np.cos)]
