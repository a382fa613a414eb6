"""Presliding (Maxwell slip): several parallel contacts, each with its own presliding distance."""

from typing import ClassVar

import numba

from estimation.effects.effect import LOSS, Parameter, Remembering
from estimation.recording import FloatArray

SPREAD = (1.0, 3.0, 9.0)
"""Presliding distances of the elements, in units of the shortest."""


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), the last travel, each element's bend / its limit."""
    for i in range(len(now)):
        moved = (now[i, 0] - state[1]) / shape[0] if state[0] else 0.0
        state[0], state[1] = 1.0, now[i, 0]
        for k in range(len(SPREAD)):
            state[2 + k] = min(max(state[2 + k] + moved / SPREAD[k], -1.0), 1.0)
            rows[i, k] = state[2 + k]


class MaxwellSlip(Remembering):
    """Parallel springs, each in series with a dry contact.

    Equation: torque = sum F_k z_k; z_k follows travel / (reach s_k) and stays within -1 and 1, s =
    1, 3, 9; z = 0 at the start. F_k in N m, reach in rad.

    Check: reverse with decreasing amplitude and plot torque against travel.

    Source: Lampaert, Al-Bender and Swevers 2003 (generalised Maxwell-slip model), its elements in
    quasi-static motion.
    """

    id = "hysteresis.presliding.maxwell"
    family = "hysteresis.presliding"
    balances = LOSS
    roles: ClassVar = {"travel": "spindle_angle_rad"}
    amplitudes = (
        Parameter("short", "target", "loss of the contact that slides first", lower=0.0),
        Parameter("middle", "target", "loss of the second contact", lower=0.0),
        Parameter("long", "target", "loss of the third contact", lower=0.0),
    )
    shape = (Parameter("reach", "travel", "travel until the first slides", 3e-4, 3.0, points=13),)
    walk = _walk
    rest = (0.0, 0.0, 0.0, 0.0, 0.0)
    told_apart_by = "reversals of shrinking amplitude, and the same ten times slower"
