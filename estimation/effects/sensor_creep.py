"""Sensor creep: a slow exponential response of a sensor to its own reading."""

from typing import ClassVar

import numba

from estimation.effects.effect import Parameter, Remembering
from estimation.effects.memory import AT_REST, behind
from estimation.effects.transmission_relaxation import SETTLED
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; the state is that of `behind`."""
    if not state[0]:
        state[3] = (shape[1] - 1.0) * now[0, 1]
    behind(now, shape, state, rows)


class SensorCreep(Remembering):
    """A reading that continues to grow exponentially after its load is constant.

    Equation: error = a (slow - reading); d slow / dt = (reading - slow) / T, slow = settled times
    the reading on the first sample. a has no unit, T in s. The immediate response is part of the
    reading's gain. Creep of the target appears through the model's prediction of it (a > 0), creep
    of a regressor with the opposite sign: motor by the projected load, gearbox by the proximal
    torque, cable and stretch by the distal torque.

    Check: hang a weight on the sensor for a minute, remove it, and record the reading.

    Source: the creep response of load cells, OIML R 60, part 1 (2017), by one exponential.
    """

    id = "sensor.creep"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1}
    roles: ClassVar = {"clock": "time_s", "creeping": "motor_load_n_m"}
    amplitudes = (Parameter("creep", "target / creeping", "fraction that is slow"),)
    shape = (
        Parameter("time_constant", "clock", "time to reach 63 %", 0.3, 60.0, points=7),
        SETTLED,
    )
    walk = _walk
    rest = AT_REST
    told_apart_by = "a weight hung on the sensor for a minute, and taken off for a minute"
