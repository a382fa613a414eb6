"""Sensor gain: a reading that is wrong by a constant factor."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class SensorGain(Proportional):
    """A factor of a reading that another amplifier, excitation or lever arm changes.

    Equation: error = gain reading; gain without unit. In all runs alike it is part of the declared
    terms; it shows as a change between runs. Where one equation alone reads the sensor, and little
    but the drive makes its reading, the gain of the drive looks the same.

    Check: load the sensor with reference weights; compare its factor with the calibration that the
    other runs were recorded with.

    Source: sensitivity of force transducers, ISO 376:2011.
    """

    id = "sensor.gain"
    roles: ClassVar = {"reading": "proximal_torque_n_m"}
    amplitudes = (Parameter("gain", "1", "change of the reading's factor"),)
    told_apart_by = "reference weights on the sensor, before and after the change"
