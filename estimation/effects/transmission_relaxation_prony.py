"""Relaxation with two time constants: a deflection that continues quickly, then slowly."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Remembering
from estimation.effects.transmission_relaxation import SETTLED, walk_lag


class Prony(Remembering):
    """Two terms of a Prony series.

    Equation: deflection lost = sum c_k (load - x_k); dx_k/dt = (load - x_k) / time_k, x_k = settled
    times the load at the start, time_2 = 8 time_1. load in N m, c_k in rad/(N m), time_k in s.

    Check: apply a step of load, hold it, and record the deflection; check the cable's pretension
    and age.

    Source: the generalised Maxwell model (Wiechert 1893), its relaxation as a Prony series.
    """

    id = "transmission.relaxation.prony"
    family = "transmission.relaxation"
    balances: ClassVar = {"gearbox": -1, "stretch": 1}
    roles: ClassVar = {"load": "distal_torque_n_m", "clock": "time_s"}
    amplitudes = (
        Parameter("fast", "target / load", "compliance of the fast part", lower=0.0),
        Parameter("slow", "target / load", "compliance of the slow part", lower=0.0),
    )
    shape = (Parameter("time", "clock", "time of the fast part", 0.02, 5.0, points=9), SETTLED)
    walk = walk_lag
    rest = (0.0, 0.0, 0.0, 0.0, 0.0)
    told_apart_by = "a step of load that is held three times as long"
