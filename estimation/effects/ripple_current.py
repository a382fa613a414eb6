"""Current ripple: a torque constant that varies with the motor angle."""

from typing import ClassVar

from estimation.effects.waves import Waves, order_of, waves_in


class CurrentRipple(Waves):
    """Variation of the magnets' flux through the windings over a turn.

    The order need not be an integer.

    Equation: torque = current (a sin(order angle) + b cos(order angle)), current in A, angle in
    rad, a and b in N m/A, order in periods per turn.

    Check: move slowly at two currents; the ripple grows in proportion to the current. Of a carriage
    on a linear motor, compare the period with its pole pitch.

    Source: Piccoli and Yim 2016 (mutual torque ripple).
    """

    id = "ripple.current"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"motor_angle": "motor_angle_rad", "current": "motor_current_a"}
    amplitudes = waves_in("target / current")
    shape = order_of("motor_angle", 0.5, 20.5, points=401)
    told_apart_by = "the same slow sweep at two currents"
