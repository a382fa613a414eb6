"""Sensor non-linearity: a sensor whose gain changes over its range."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Pointwise, Row, Shape


class NonlinearGain(Pointwise):
    """The quadratic and cubic terms of a reading, and a gain that grows with its size.

    Equation: error = a reading^2 + b reading^3 + c reading |reading|; a, b and c in the target's
    unit per power of the reading. Non-linearity of the target appears through the model's
    prediction of it, non-linearity of a regressor directly: motor by the projected load or the
    current, gearbox by the proximal torque, cable by the distal torque, stretch by the distal
    torque or the spindle's angle.

    Check: load the sensor with reference weights over its whole range, with both signs.

    Source: polynomial calibration of force transducers, ISO 376:2011, annex (cubic fit).
    """

    id = "sensor.gain_nonlinear"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1, "grasp": 1}
    roles: ClassVar = {"reading": "motor_load_n_m"}
    amplitudes: ClassVar[tuple[Parameter, ...]] = (
        Parameter("square", "target / reading / reading", "quadratic term"),
        Parameter("cube", "target / reading / reading / reading", "cubic term"),
        Parameter("sided", "target / reading / reading", "signed square: gain by the load's size"),
    )
    told_apart_by = "reference weights over the sensor's whole range, both signs"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        reading = inputs["reading"]
        square = reading * reading
        return square, square * reading, reading * np.abs(reading)


class SensorGainBySide(NonlinearGain):
    """A gain of its own for either sign of the load, as of a load cell in tension and compression.

    Equation: error = a |reading|, a in the target's unit per unit of the reading: half the gain of
    reading > 0 less that of reading < 0.

    Check: load the sensor with the same reference weight in both directions.

    Source: ISO 376:2011, which calibrates a force transducer in tension and in compression apart.
    """

    id = "sensor.gain_nonlinear.by_side"
    meaning = "a sensor whose gain differs by the sign of its load"
    balances: ClassVar = {}
    amplitudes = (
        Parameter("asymmetry", "target / reading", "half the gain of reading > 0 less < 0"),
    )
    told_apart_by = "the same reference weight in both directions"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (np.abs(inputs["reading"]),)
