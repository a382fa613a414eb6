"""Backlash: deflection that comes at once when the load changes its side."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class Backlash(Pointwise):
    """Play of teeth or keys, crossed when the load passes through zero.

    Equation: deflection = gap tanh((load - middle) / width). The middle is not zero where the
    sensor's zero is off. It is crossed at a load far below those carried; a bend that takes longer
    is a stiffness that changes.

    Source: Nordin and Gutman 2002 (models of mechanical systems with backlash), the dead zone as
    seen from the load, with a soft edge.
    """

    id = "transmission.backlash"
    balances: ClassVar = {"gearbox": 1, "stretch": -1}
    roles: ClassVar = {"load": "proximal_torque_n_m"}
    amplitudes = (Parameter("gap", "target", "half the play", lower=0.0),)
    shape = (
        Parameter("width", "load", "load at which 76 % is crossed", 5e-4, 0.015, points=6),
        Parameter("middle", "load", "load in the middle of the play", -0.1, 0.1, True, points=7),
    )
    confused_with = ("hysteresis.presliding", "transmission.stiffening", "friction.coulomb")
    told_apart_by = "a load that passes slowly through zero, in both directions"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        return (np.tanh((inputs["load"] - shape[1]) / shape[0]),)
