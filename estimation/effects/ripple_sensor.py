"""Sensor ripple: a torque sensor whose reading repeats along the turn of a shaft."""

from typing import ClassVar

from estimation.effects.waves import Waves, order_of


class SensorRipple(Waves):
    """A part of a reading that repeats over a turn and that no torque has.

    Causes are strain gauges on the flexible spline of a harmonic gear, whose own deformation they
    read too, and a torque cell that turns with a shaft and is out of line with it.

    Equation: error = a sin(order angle) + b cos(order angle), a and b in the target's unit, angle
    in rad, order in periods per turn. The true load is the reading less this error.

    Check: turn the shaft slowly without a load and watch the reading.

    Source: Taghirad and Belanger 1998 (ripple of torque sensors in harmonic drives).
    """

    id = "ripple.sensor"
    roles: ClassVar = {"turning_angle": "motor_angle_rad"}
    shape = order_of("turning_angle", 0.5, 20.5, points=401)
    told_apart_by = "a slow turn without a load"
