"""Output ripple: torque or angle that repeats along the turn of a shaft, a gear or a pulley."""

from typing import ClassVar

from estimation.effects.effect import READING
from estimation.effects.waves import Waves, harmonics_in, order_of


class OutputRipple(Waves):
    """A periodic error over the spindle's turn: bent shaft, gear teeth or notched pulley.

    Equation: torque or angle = a sin(order angle) + b cos(order angle), a and b in the target's
    unit (N m or rad), angle in rad, order in periods per turn. The order need not be an integer. It
    is below the gear ratio: a period of one motor turn or less belongs to the motor.

    Check: measure the runout of the output shaft and pulley; inspect the last gear stage. Of a
    carriage, compare the period with the lead of the screw and the pitch of the belt or the rack.

    Source: order tracking of rotating machines; Randall 2011, "Vibration-based Condition
    Monitoring", section 3.6.
    """

    id = "ripple.output"
    balances: ClassVar = {**READING, "motor": -1, "grasp": -1}
    roles: ClassVar = {"output_angle": "spindle_angle_rad"}
    # the spindle turns by a third of a turn: orders closer than 0.5 are indistinguishable
    shape = order_of("output_angle", 1.0, 32.0, points=63)
    told_apart_by = "a sweep at a slow constant speed over several turns, and under another load"


class OutputHarmonics(OutputRipple):
    """A periodic error over the output's turn that is not a pure sine, such as tooth meshing.

    Equation: torque or angle = sum over n = 1, 2, 3 of a_n sin(n order angle) + b_n cos(n order
    angle), a_n and b_n in the target's unit (N m or rad), angle in rad, order in periods per turn.

    Check: compare the periods per turn with the number of teeth; inspect the last gear stage. Of a
    carriage, compare the period with the lead of the screw and the pitch of the belt or the rack.

    Source: harmonics of the meshing frequency; Randall 2011, "Vibration-based Condition
    Monitoring", section 2.2.
    """

    id = "ripple.output.harmonics"
    meaning = (
        "torque or angle that repeats along the turn of a shaft, a gear or a pulley, not"
        " as a pure sine"
    )
    amplitudes = harmonics_in("target")
    # the spindle turns by a third of a turn: orders closer than 0.5 are indistinguishable
    shape = order_of("output_angle", 1.0, 16.0, points=31)
