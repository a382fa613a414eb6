"""Offset: a constant in the equation, such as the zero of a torque sensor."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from estimation.effects.effect import Effect, Parameter
from estimation.recording import FloatArray


class Offset(Effect):
    """A constant.

    Equation: torque = b, b in N m.

    Check: read the unloaded sensor at standstill before and after a run.

    Source: O'Neill et al. 2018, section II.E (the linear fit's intercept).
    """

    id = "sensor.offset"
    roles: ClassVar = {"clock": "time_s"}
    amplitudes = (Parameter("offset", "target", "constant part, such as a wrong zero"),)
    told_apart_by = "the unloaded sensor at standstill before and after a run"

    def columns(self, inputs: Mapping[str, FloatArray], shape: Sequence[float]) -> FloatArray:
        """Return a column of ones, shape (n, 1)."""
        return np.ones((len(inputs["clock"]), 1))

    def step(
        self, inputs: Mapping[str, float], shape: Sequence[float], state: list[float]
    ) -> Sequence[float]:
        """Return one."""
        return (1.0,)
