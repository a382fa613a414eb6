"""Link compliance: a linear spring between two encoders."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class LinkCompliance(Proportional):
    """A linear spring between two measured angles.

    Equation: angle = load / stiffness, angle in rad, load in N m, stiffness in N m/rad. The
    parameter is the compliance 1 / stiffness in rad/(N m).

    Check: block the output, load it slowly to both ends of the range, and plot angle against
    torque.

    Source: De Luca and Book, "Robots with Flexible Elements", Springer Handbook of Robotics 2008,
    chapter 13.
    """

    id = "compliance.link"
    balances: ClassVar = {"gearbox": 1, "stretch": -1}
    roles: ClassVar = {"load": "proximal_torque_n_m"}
    amplitudes = (Parameter("compliance", "target / load", "deflection per unit of load", 0.0),)
    told_apart_by = "a slow ramp of the load through zero to both ends of its range"
