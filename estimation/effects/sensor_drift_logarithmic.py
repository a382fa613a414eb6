"""Logarithmic sensor drift: a zero that changes with the logarithm of time."""

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
        rows[i, 0] = np.log1p((now[i, 0] - state[1]) / shape[0])


class LogarithmicDrift(Remembering):
    """A zero that changes by the same amount in each decade of time, as polymers relax.

    Equation: error = a ln(1 + t / T), t from the first sample of the run. a in the target's unit, T
    in s.

    Check: read the unloaded sensor at standstill before, during and after a run.

    Source: drift of piezoresistive force sensors, stated by their makers as % for each decade of
    time; Hall et al. 2008 for force-sensing resistors.
    """

    id = "sensor.drift.logarithmic"
    family = "sensor.drift"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1, "grasp": 1}
    roles: ClassVar = {"clock": "time_s"}
    amplitudes = (Parameter("drift", "target", "change per factor 2.7 of time"),)
    shape = (Parameter("onset", "clock", "time when the change slows", 0.05, 50.0, points=4),)
    walk = _walk
    rest = (0.0, 0.0)
    told_apart_by = "the unloaded sensor at standstill before, during and after a run"
