"""Sensor delay: a reading that arrives late as a whole."""

from typing import ClassVar

import numba

from estimation.effects.effect import Parameter, Remembering
from estimation.recording import FloatArray

PLACES = 64
"""Samples the ring remembers."""

SPAN = 60
"""Parts of a delay; samples nearer to one another than one part are not all remembered, so that the
ring reaches over the delay at any rate."""

_COUNT, _TIMES = 0, 1
_VALUES = _TIMES + PLACES


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Walk; state: samples remembered so far, their times as a ring, their values as a ring."""
    delay = shape[0]
    for i in range(len(now)):
        time, value = now[i, 0], now[i, 1]
        count = int(state[_COUNT])
        later, late_value = time, value  # the youngest known point not before the time asked for
        past = value
        for back in range(1, min(count, PLACES) + 1):
            place = (count - back) % PLACES
            earlier, early_value = state[_TIMES + place], state[_VALUES + place]
            past = early_value  # before the first sample it has always been the first value
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
    """A reading that is late by a constant time, which need not be whole samples.

    Equation: error = a (reading(t - d) - reading(t)), straight between samples. A late target shows
    through what the balance says of it (a > 0), a late regressor as the opposite (a < 0): motor by
    the projected load or the current, gearbox by the proximal torque, cable by the distal torque,
    stretch by the distal torque or the spindle's angle, which stands for the jaw's too. Where the
    motion is slow against the delay, only the product a d is told.

    Source: transport delay of sampled instruments; Ljung 1999, "System Identification", chapter 4.
    """

    id = "sensor.delay"
    balances: ClassVar = {
        "motor": 1,
        "gearbox": 1,
        "cable": 1,
        "stretch": 1,
        "grasp": 1,
        "joint": 1,
    }
    roles: ClassVar = {"clock": "time_s", "reading": "motor_current_a"}
    # a late reading weighs as much as the reading: 1 for the target's own, at most 1.5 on the rig
    amplitudes = (Parameter("gain", "target / reading", "weight of the late reading", -2.0, 2.0),)
    shape = (Parameter("delay", "clock", "how late it is", 2e-4, 5e-2, points=6),)
    walk = _walk
    rest = (0.0,) * (_VALUES + PLACES)
    projected_roles = ("reading",)
    confused_with = (
        "sensor.lag",
        "motor.electrical",
        "inertia.missing",
        "friction.viscous",
        "friction.stribeck",
    )
    told_apart_by = "a chirp: the delay's phase grows with frequency, its gain does not fall"
