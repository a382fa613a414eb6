"""Ripple: torque or force that repeats along the turn or travel of a drive, such as cogging."""

from typing import ClassVar

from estimation.effects.waves import Waves, harmonics_in, order_of


class MotorRipple(Waves):
    """Cogging and commutation of the motor. The order need not be an integer.

    Equation: torque = a sin(order angle) + b cos(order angle), a and b in N m, angle in rad, order
    in periods per turn.

    Check: move it slowly without current and feel the cogging. Of a shaft, compare the periods per
    turn with the numbers of poles, slots and commutator segments; of a carriage, compare the period
    with the lead of the screw, the pitch of the belt and the pole pitch of a linear motor.

    Source: Piccoli and Yim 2016 (cogging maps of motors).
    """

    id = "ripple.motor"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"motor_angle": "motor_angle_rad"}
    shape = order_of("motor_angle", 0.5, 20.5, points=401)
    told_apart_by = "a sweep at a slow constant speed, and coasting without current"


class MotorHarmonics(MotorRipple):
    """A wave over the turn or travel of a drive that is not a pure sine, such as a belt's seam.

    Equation: torque = sum over n = 1, 2, 3 of a_n sin(n order angle) + b_n cos(n order angle), a_n
    and b_n in N m, angle in rad, order in periods per turn.

    Check: move it slowly without current and feel where it is stiff. Compare the period with the
    length of the belt, the turn of its rollers, and the numbers of blades and teeth.

    Source: periodic impulses of a local defect; Randall 2011, "Vibration-based Condition
    Monitoring", section 2.2.
    """

    id = "ripple.motor.harmonics"
    meaning = "torque or force that repeats along the turn or travel of a drive, not as a pure sine"
    amplitudes = harmonics_in("target")
    shape = order_of("motor_angle", 0.5, 16.0, points=311)
