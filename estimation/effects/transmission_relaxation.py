"""Relaxation: a deflection that continues after the load is constant."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import Parameter, Parameters, Remembering
from estimation.recording import FloatArray


@numba.njit(cache=True)
def walk_lag(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), its time and load, the load less its lag.

    Where there are several columns, each is `SLOWER` times slower than the one before.
    """
    for i in range(len(now)):
        load, clock = now[i, 0], now[i, 1]
        if state[0]:
            span, change = clock - state[1], load - state[2]
            time = shape[0]
            for k in range(rows.shape[1]):
                # exact for a load that changes evenly between two samples
                part = span / time
                gone = -np.expm1(-part)
                share = gone / part if part > 0.0 else 1.0
                state[3 + k] = state[3 + k] * (1.0 - gone) + change * share
                time *= SLOWER
        else:
            for k in range(rows.shape[1]):
                state[3 + k] = (1.0 - shape[1]) * load
        state[0], state[1], state[2] = 1.0, clock, load
        for k in range(rows.shape[1]):
            rows[i, k] = state[3 + k]


SETTLED = Parameter(
    "settled", "1", "fraction of the first load that has settled", 0, 1, linear=True, points=2
)

SLOWER = 8.0
"""Ratio of the times of neighbouring elements of a Prony series."""


class Relaxation(Remembering):
    """The standard linear solid: the part of the final deflection that a cable has not yet reached.

    Equation: deflection lost = c (load - x); dx/dt = (load - x) / time, x = settled times the load
    at the start, because a run may begin soon after its load was applied. load in N m, c in
    rad/(N m), time in s, settled without unit.

    Check: apply a step of load, hold it, and record the deflection; check the cable's pretension
    and age.

    Source: the standard linear solid of Zener 1948.
    """

    id = "transmission.relaxation"
    balances: ClassVar = {"gearbox": -1, "stretch": 1}
    roles: ClassVar = {"load": "distal_torque_n_m", "clock": "time_s"}
    amplitudes: ClassVar[Parameters] = (
        Parameter("compliance", "target / load", "compliance of the slow part", lower=0.0),
    )
    shape = (
        Parameter("time", "clock", "time to reach 63 %", 0.02, 30.0),
        SETTLED,
    )
    walk = walk_lag
    rest: ClassVar[tuple[float, ...]] = (0.0, 0.0, 0.0, 0.0)
    told_apart_by = "a step of load that is held three times as long"


class Prony(Relaxation):
    """Two terms of a Prony series.

    Equation: deflection lost = sum c_k (load - x_k); dx_k/dt = (load - x_k) / time_k, x_k = settled
    times the load at the start, time_2 = 8 time_1. load in N m, c_k in rad/(N m), time_k in s.

    Check: apply a step of load, hold it, and record the deflection; check the cable's pretension
    and age.

    Source: the generalised Maxwell model (Wiechert 1893), its relaxation as a Prony series.
    """

    id = "transmission.relaxation.prony"
    meaning = "a deflection that continues with two time constants after the load is constant"
    amplitudes = (
        Parameter("fast", "target / load", "compliance of the fast part", lower=0.0),
        Parameter("slow", "target / load", "compliance of the slow part", lower=0.0),
    )
    shape = (Parameter("time", "clock", "time of the fast part", 0.02, 5.0, points=9), SETTLED)
    rest = (0.0, 0.0, 0.0, 0.0, 0.0)
