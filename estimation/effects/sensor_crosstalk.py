"""Crosstalk: a sensor that answers to what another one measures."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class Crosstalk(Proportional):
    """A share of another quantity in a torque reading: motor current, another axis, a bent mount.

    Equation: error = a other_reading. What leaks into the target or into a regressor: motor from
    the jaw's angle, gearbox from the current or the distal torque, cable from the current, stretch
    from the proximal torque or the current.

    Source: the cross-axis terms of the calibration matrix of multi-axis transducers, ISO 376:2011
    and any six-axis sensor's certificate.
    """

    id = "sensor.crosstalk"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1}
    roles: ClassVar = {"other_reading": "motor_current_a"}
    amplitudes = (Parameter("share", "target / other_reading", "what one unit of it adds"),)
    projected_roles = ("other_reading",)  # what the balance lacks is in the other reading too
    confused_with = ("friction.load", "spring.position", "coupling.torque", "gravity.payload")
    told_apart_by = "the other quantity moved while the sensor is unloaded"
