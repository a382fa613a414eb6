"""Sensor creep: a slow answer of a sensor to its own reading."""

from typing import ClassVar

import numba

from estimation.effects.effect import Parameter, Remembering
from estimation.effects.first_order import AT_REST, behind
from estimation.effects.transmission_relaxation import SETTLED
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Walk; the state is that of `behind`."""
    if not state[0]:
        state[3] = (shape[1] - 1.0) * now[0, 1]
    behind(now, shape, state, rows)


class SensorCreep(Remembering):
    """A reading that goes on growing, by an exponential, after its load stands still.

    Equation: error = a (slow - reading); d slow / dt = (reading - slow) / T, slow = settled times
    the reading on the first sample. The share that answers at once is within the reading's own
    gain. Creep of the target shows through what the balance says of it (a > 0), creep of a
    regressor as the opposite: motor by the projected load, gearbox by the proximal torque, cable
    and stretch by the distal torque.

    Source: the creep response of load cells, OIML R 60, part 1 (2017), by one exponential.
    """

    id = "sensor.creep"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1}
    roles: ClassVar = {"clock": "time_s", "creeping": "motor_load_n_m"}
    amplitudes = (Parameter("creep", "target / creeping", "share that comes slowly", -1.0, 1.0),)
    shape = (
        Parameter("time_constant", "clock", "time until 63 % of it", 0.3, 60.0, points=7),
        SETTLED,
    )
    walk = _walk
    rest = AT_REST
    confused_with = (
        "sensor.drift",
        "sensor.lag",
        "sensor.gain_nonlinear",
        "transmission.relaxation",
        "motor.thermal",
        "friction.warmup",
    )
    told_apart_by = "a weight hung on the sensor for a minute, and taken off for a minute"
