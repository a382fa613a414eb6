"""Asymmetric stiffness: different stiffness in the two directions of load."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class AsymmetricStiffness(Pointwise):
    """A transmission that deflects more in one direction of load than in the other.

    Equation: deflection = c |load|, load in N m, c in rad/(N m): half the compliance of closing
    minus half that of opening.

    Check: load slowly to both sides against a reference weight and compare the slopes.

    Source: Hooke's law with a separate constant for either side.
    """

    id = "transmission.stiffening.asymmetric"
    family = "transmission.stiffening"
    balances: ClassVar = {"gearbox": 1, "stretch": -1}
    roles: ClassVar = {"load": "proximal_torque_n_m"}
    amplitudes = (
        Parameter("asymmetry", "target / load", "half the compliance of closing minus opening"),
    )
    told_apart_by = "a slow ramp of load against a reference weight, to both sides"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        return (np.abs(inputs["load"]),)
