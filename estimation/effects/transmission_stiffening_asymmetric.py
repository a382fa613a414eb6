"""Asymmetric stiffness: another stiffness to either side."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class AsymmetricStiffness(Pointwise):
    """A transmission that yields more to one side than to the other.

    Equation: deflection = c |load|.

    Source: Hooke's law with a constant of its own for either side.
    """

    id = "transmission.stiffening.asymmetric"
    family = "transmission.stiffening"
    balances: ClassVar = {"gearbox": 1, "stretch": -1}
    roles: ClassVar = {"load": "proximal_torque_n_m"}
    amplitudes = (
        Parameter("asymmetry", "target / load", "half the compliance of closing less of opening"),
    )
    confused_with = ("transmission.backlash", "sensor.gain_nonlinear")
    told_apart_by = "a slow ramp of load against a reference weight, to both sides"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        return (np.abs(inputs["load"]),)
