"""Link compliance: what lies between two encoders gives way in proportion to its torque."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class LinkCompliance(Proportional):
    """A linear spring between two angles.

    Equation: angle = load / stiffness, written with the compliance 1 / stiffness.

    Source: De Luca and Book, "Robots with Flexible Elements", Springer Handbook of Robotics 2008,
    chapter 13.
    """

    id = "compliance.link"
    balances: ClassVar = {"gearbox": 1, "stretch": -1}
    roles: ClassVar = {"load": "proximal_torque_n_m"}
    amplitudes = (Parameter("compliance", "target / load", "deflection for a unit of load", 0.0),)
    confused_with = ("transmission.stiffening", "transmission.backlash")
    told_apart_by = "a slow ramp of the load through zero to both ends of its range"
