"""Sensor delay: a reading with a constant transport delay."""

from typing import ClassVar

import numba

from estimation.effects.effect import READING, Parameter, Remembering
from estimation.recording import FloatArray

PLACES = 64
"""Number of samples in the ring buffer."""

SPAN = 60
"""Parts of a delay; samples closer together than one part are not all stored, so that the ring
buffer covers the delay at any sample rate."""

_COUNT, _TIMES = 0, 1
_VALUES = _TIMES + PLACES


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: number of stored samples, ring of their times, ring of their values."""
    delay = shape[0]
    for i in range(len(now)):
        time, value = now[i, 0], now[i, 1]
        count = int(state[_COUNT])
        later, late_value = time, value  # the known point at or after the delayed time
        past = value
        for back in range(1, min(count, PLACES) + 1):
            place = (count - back) % PLACES
            earlier, early_value = state[_TIMES + place], state[_VALUES + place]
            past = early_value  # before the first sample the value is the first one
            if earlier <= time - delay:
                if later > earlier:
                    share = (time - delay - earlier) / (later - earlier)
                    past = early_value + share * (late_value - early_value)
                break
            later, late_value = earlier, early_value
        rows[i, 0] = past - value
        newest = state[_TIMES + (count - 1) % PLACES]
        if count == 0 or time - newest >= delay / SPAN:
            state[_TIMES + count % PLACES] = time
            state[_VALUES + count % PLACES] = value
            state[_COUNT] = count + 1


class SensorDelay(Remembering):
    """A reading that is late by a constant time, which need not be a multiple of the sample period.

    Equation: error = a (reading(t - d) - reading(t)), linear between samples, a in the target's
    unit per unit of the reading, d in s. A late target appears through the model's prediction of it
    (a > 0), a late regressor with the opposite sign (a < 0): motor by the projected load or the
    current, gearbox by the proximal torque, cable by the distal torque, stretch by the distal
    torque or the spindle's angle, which also represents the jaw's. Where the motion is slow
    compared with the delay, only the product a d is identifiable.

    Check: compare the filter settings and sample timing of the channels; a chirp shows the delay.

    Source: transport delay of sampled instruments; Ljung 1999, "System Identification", chapter 4.
    """

    id = "sensor.delay"
    balances = READING
    roles: ClassVar = {"clock": "time_s", "reading": "motor_current_a"}
    amplitudes = (Parameter("gain", "target / reading", "weight of the late reading"),)
    shape = (Parameter("delay", "clock", "transport delay", 2e-4, 5e-2, points=6),)
    walk = _walk
    rest = (0.0,) * (_VALUES + PLACES)
    told_apart_by = "a chirp: the delay's phase grows with frequency, its gain does not fall"
