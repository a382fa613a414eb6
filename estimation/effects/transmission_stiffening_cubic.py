"""Cubic stiffening: the first odd non-linear term of a stiffness curve."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from estimation.effects.effect import Parameter, Pointwise


class CubicStiffening(Pointwise):
    """A stiffness curve that bends without a knee; c is negative where it softens.

    Equation: deflection lost = c load^3, load in N m, c in rad/(N m)^3.

    Check: load slowly to both sides against a reference weight and plot deflection against load.

    Source: the stiffness of flexible gears by an odd polynomial, Tuttle and Seering 1996.
    """

    id = "transmission.stiffening.cubic"
    family = "transmission.stiffening"
    balances: ClassVar = {"gearbox": -1, "stretch": 1}
    roles: ClassVar = {"load": "proximal_torque_n_m"}
    amplitudes = (
        Parameter("bend", "target / load / load / load", "deflection lost at one unit of load"),
    )
    told_apart_by = "a slow ramp of load against a reference weight, to both sides"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        return (inputs["load"] ** 3,)
