"""Compliance by position: a transmission that bends more at one end of its travel."""

from typing import ClassVar

from estimation.effects.along import along, amplitudes_along
from estimation.effects.effect import Inputs, Pointwise, Row, Shape


class ComplianceByPosition(Pointwise):
    """A compliance that changes along the travel, as the free length of a rope or a screw does.

    Equation: deflection = load (a position + b position^2 + c position^3), load in N m, position in
    rad, a in rad/(N m)/rad, b per rad^2, c per rad^3.

    Check: load the output with one reference weight at several positions; compare the deflections.

    Source: a rod of length l and section A yields by l / (E A) per unit of load (Hooke), to third
    order in the position.
    """

    id = "transmission.compliance_by_position"
    balances: ClassVar = {"gearbox": 1, "stretch": -1}
    roles: ClassVar = {"load": "distal_torque_n_m", "position": "spindle_angle_rad"}
    amplitudes = amplitudes_along("load")
    told_apart_by = "one reference weight at several positions"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return along("load", inputs)
