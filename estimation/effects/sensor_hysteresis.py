"""Hysteresis of a sensor: a reading that is behind its load, by a loop over the load."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Remembering
from estimation.effects.hysteresis_bouc_wen import walk_from_load
from estimation.effects.transmission_relaxation import SETTLED


class SensorHysteresis(Remembering):
    """A reading that differs between a load that grows and one that falls.

    Equation: error = a z; dz / d reading = (1 - |z|^n (1 + sign(z d reading)) / 2) / reach. a in
    the target's unit, reach in that of the reading, n is the sharpness without unit. At the start
    of a run the loop is that of a single loading from `settled` times the first reading, where z =
    0.

    Check: load the sensor in steps up to its largest load and down again, and compare the readings.

    Source: the hysteresis of load cells, OIML R 60, part 1 (2017); the loop of Bouc 1967 and Wen
    1976, "Method for random vibration of hysteretic systems".
    """

    id = "sensor.hysteresis"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1}
    roles: ClassVar = {"reading": "distal_torque_n_m"}
    amplitudes = (Parameter("width", "target", "half the width of the loop"),)
    shape = (
        Parameter("reach", "reading", "load from middle to end of loop", 1e-3, 1.0, points=9),
        Parameter("sharpness", "1", "sharpness of the corners", 1.0, 4.0, points=3),
        SETTLED,
    )
    walk = walk_from_load
    rest = (0.0, 0.0, 0.0)
    told_apart_by = "steps of load up and down again"
