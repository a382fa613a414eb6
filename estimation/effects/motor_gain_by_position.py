"""Gain by position: a drive whose gain changes along its travel."""

from typing import ClassVar

from estimation.effects.along import along, amplitudes_along
from estimation.effects.effect import Inputs, Pointwise, Row, Shape


class GainByPosition(Pointwise):
    """A force or torque constant that depends on where the moving part is in the magnet's field.

    Equation: torque = current (a position + b position^2 + c position^3), current in A, position in
    rad, a in N m/(A rad), b in N m/(A rad^2), c in N m/(A rad^3).

    Check: measure the stall torque at one current at several positions.

    Source: the force factor Bl(x) of a moving coil; Klippel, "Loudspeaker Nonlinearities", J. Audio
    Eng. Soc. 54 (2006).
    """

    id = "motor.gain_by_position"
    balances: ClassVar = {"grasp": -1}
    roles: ClassVar = {"current": "motor_current_a", "position": "spindle_angle_rad"}
    amplitudes = amplitudes_along("current")
    told_apart_by = "stall at one current at several positions"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return along("current", inputs)
