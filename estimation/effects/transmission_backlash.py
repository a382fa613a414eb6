"""Backlash: free travel that is crossed when the load changes its sign."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class Backlash(Pointwise):
    """Play of teeth or keys, crossed when the load passes through zero.

    Equation: deflection = gap tanh((load - middle) / width), gap in rad, load, middle and width in
    N m. The middle is not zero where the sensor's zero is off. The play is crossed at a load far
    below the working load; a deflection that needs more load is a non-linear stiffness.

    Check: block the output, turn the input to and fro by hand and measure the free travel.

    Source: Nordin and Gutman 2002 (models of mechanical systems with backlash), the dead zone as a
    function of the load, with smooth edges.
    """

    id = "transmission.backlash"
    balances: ClassVar = {"gearbox": 1, "stretch": -1}
    roles: ClassVar = {"load": "proximal_torque_n_m"}
    amplitudes = (Parameter("gap", "target", "half the free travel", lower=0.0),)
    shape = (
        Parameter("width", "load", "load at which the tanh reaches 76 %", 5e-4, 0.015, points=6),
        Parameter("middle", "load", "load in the middle", -0.1, 0.1, True, points=7),
    )
    told_apart_by = "a load that passes slowly through zero, in both directions"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        return (np.tanh((inputs["load"] - shape[1]) / shape[0]),)
