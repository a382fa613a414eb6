"""Sensor warm-up drift: a zero that settles exponentially after power-on."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import Parameter, Remembering
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), the time of the first."""
    for i in range(len(now)):
        if not state[0]:
            state[0], state[1] = 1.0, now[i, 0]
        rows[i, 0] = 1.0 - np.exp(-(now[i, 0] - state[1]) / shape[0])


class SettlingDrift(Remembering):
    """A zero that approaches its warm value exponentially.

    Equation: error = a (1 - exp(-t / T)), t from the first sample of the run. a in the target's
    unit, T in s.

    Check: let the amplifier warm up and read the unloaded sensor at standstill before and after a
    run.

    Source: Newton's law of cooling, for a strain gauge heated by its own bridge.
    """

    id = "sensor.drift.exponential"
    family = "sensor.drift"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1, "grasp": 1}
    roles: ClassVar = {"clock": "time_s"}
    amplitudes = (Parameter("drift", "target", "warm zero minus cold zero"),)
    shape = (Parameter("time_constant", "clock", "time to reach 63 %", 0.5, 100.0, points=6),)
    walk = _walk
    rest = (0.0, 0.0)
    told_apart_by = "the unloaded sensor at standstill before, during and after a run"
