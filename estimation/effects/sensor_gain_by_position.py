"""Sensor gain by position: a sensor whose gain changes along the travel."""

from typing import ClassVar

from estimation.effects.along import along, amplitudes_along
from estimation.effects.effect import Inputs, Pointwise, Row, Shape


class SensorGainByPosition(Pointwise):
    """A factor of a reading that depends on where the load acts, as a lever arm makes it.

    Equation: error = reading (a position + b position^2 + c position^3), position in rad, a in
    1/rad, b in 1/rad^2, c in 1/rad^3. The true load is the reading less this error.

    Check: load the sensor with one reference weight at several positions.

    Source: the eccentric loading error of a weighing instrument, OIML R 76-1 (2006), to third
    order in the position.
    """

    id = "sensor.gain_by_position"
    roles: ClassVar = {"reading": "distal_torque_n_m", "position": "spindle_angle_rad"}
    amplitudes = amplitudes_along("reading")
    told_apart_by = "one reference weight at several positions"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return along("reading", inputs)
