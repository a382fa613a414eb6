"""Stiffening: a transmission that yields less the more it carries."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class Stiffening(Pointwise):
    """Two stiffnesses with a soft knee: teeth that come into contact, a cable that is drawn taut.

    Equation: deflection lost = c (load - knee tanh(load / knee)).

    Source: the stiffness curve of gearheads as makers state it, a soft and a stiff part.
    """

    id = "transmission.stiffening"
    balances: ClassVar = {"gearbox": -1, "stretch": 1}
    roles: ClassVar = {"load": "proximal_torque_n_m"}
    amplitudes = (Parameter("compliance", "target / load", "compliance that is lost", lower=0.0),)
    shape = (Parameter("knee", "load", "load at the knee", 0.02, 1.0, points=9),)
    other_below = ("knee",)  # a knee at no load is play
    confused_with = ("transmission.backlash", "sensor.gain_nonlinear", "spring.end_stop")
    told_apart_by = "a slow ramp of load against a reference weight, to both sides"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        return (inputs["load"] - shape[0] * np.tanh(inputs["load"] / shape[0]),)
