"""Stiffening: a transmission whose stiffness grows with the load."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class Stiffening(Pointwise):
    """Two stiffnesses with a smooth transition, of teeth in contact or a cable pulled straight.

    Equation: deflection lost = c (load - knee tanh(load / knee)), load and knee in N m, c in
    rad/(N m).

    Check: load slowly to both sides against a reference weight and plot deflection against load;
    check the cable's pretension.

    Source: the stiffness curve of gearheads as makers state it, a soft and a stiff part.
    """

    id = "transmission.stiffening"
    balances: ClassVar = {"gearbox": -1, "stretch": 1}
    roles: ClassVar = {"load": "proximal_torque_n_m"}
    amplitudes = (Parameter("compliance", "target / load", "compliance lost at load", lower=0.0),)
    shape = (Parameter("knee", "load", "load at the knee", 0.02, 1.0, points=9),)
    told_apart_by = "a slow ramp of load against a reference weight, to both sides"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        return (inputs["load"] - shape[0] * np.tanh(inputs["load"] / shape[0]),)
