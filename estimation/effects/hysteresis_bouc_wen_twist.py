"""Hysteresis of a spring: a deflection with a smooth hysteresis loop over load."""

from typing import ClassVar

import numba

from estimation.effects.effect import Parameter, Remembering
from estimation.effects.hysteresis_bouc_wen import walk_loop
from estimation.effects.transmission_relaxation import SETTLED
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; the state is that of `walk_loop`."""
    if not state[0]:
        state[0], state[1] = 1.0, shape[2] * now[0, 0]
    walk_loop(now, shape, state, rows)


class Twist(Remembering):
    """The part of a cable's or a shaft's deflection that is delayed by rubbing wires.

    Equation: deflection lost = F z; dz / d load = (1 - |z|^n (1 + sign(z d load)) / 2) / reach. F
    in rad, reach in N m, n is the sharpness without unit. At the start of a run the loop is that of
    a single loading from `settled` times the first load, where z = 0.

    Check: load slowly up and down with growing and decreasing amplitude and plot deflection against
    load.

    Source: Bouc 1967 and Wen 1976, "Method for random vibration of hysteretic systems", with beta =
    gamma, the load in the place of the deflection.
    """

    id = "hysteresis.bouc_wen.twist"
    family = "hysteresis.bouc_wen"
    balances: ClassVar = {"gearbox": -1, "stretch": 1}
    roles: ClassVar = {"load": "distal_torque_n_m"}
    amplitudes = (Parameter("lost", "target", "half the width of the loop", lower=0.0),)
    shape = (
        Parameter("reach", "load", "load from middle to end of loop", 1e-3, 1.0, points=9),
        Parameter("sharpness", "1", "sharpness of the corners", 1.0, 4.0, points=3),
        SETTLED,
    )
    walk = _walk
    rest = (0.0, 0.0, 0.0)
    told_apart_by = "loads of slowly growing and shrinking amplitude, and the same ten times slower"
