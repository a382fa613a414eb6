"""Sensor crosstalk: a sensor that responds to another measured quantity."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class Crosstalk(Proportional):
    """A fraction of another quantity in a torque reading.

    The other quantity is the motor current or another axis; a bent mount is one cause.

    Equation: error = a other_reading, a in the target's unit per unit of the other reading. The
    other quantity in each equation: jaw angle for the motor, current or distal torque for the
    gearbox, current for the cable, proximal torque or current for the stretch.

    Check: vary the other quantity while the sensor is unloaded; check the shielding of its wires.

    Source: the cross-axis terms of the calibration matrix of multi-axis transducers, ISO 376:2011
    and any six-axis sensor's certificate.
    """

    id = "sensor.crosstalk"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1}
    roles: ClassVar = {"other_reading": "motor_current_a"}
    amplitudes = (Parameter("share", "target / other_reading", "reading added per unit of it"),)
    told_apart_by = "the other quantity moved while the sensor is unloaded"
