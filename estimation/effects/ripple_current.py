"""Current ripple: a torque constant that varies with the motor angle."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Pointwise, Row, Shape


class CurrentRipple(Pointwise):
    """Variation of the magnets' flux through the windings over a turn.

    The order need not be an integer.

    Equation: torque = current (a sin(order angle) + b cos(order angle)), current in A, angle in
    rad, a and b in N m/A, order in periods per turn.

    Check: turn slowly at two currents; the ripple grows in proportion to the current.

    Source: Piccoli and Yim 2016 (mutual torque ripple).
    """

    id = "ripple.current"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"motor_angle": "motor_angle_rad", "current": "motor_current_a"}
    amplitudes = (
        Parameter("sine", "target / current", "amplitude of the sine"),
        Parameter("cosine", "target / current", "amplitude of the cosine"),
    )
    shape = (Parameter("order", "1", "periods per turn", 0.5, 20.5, linear=True, points=401),)
    told_apart_by = "the same slow sweep at two currents"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        phase = shape[0] * inputs["motor_angle"]
        return inputs["current"] * np.sin(phase), inputs["current"] * np.cos(phase)
