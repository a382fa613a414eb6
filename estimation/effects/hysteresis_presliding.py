"""Presliding (Dahl): a contact that deflects elastically before it slides."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import LOSS, Parameter, Remembering
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), the last travel, the deflection / its limit."""
    for i in range(len(now)):
        travel = now[i, 0]
        moved = (travel - state[1]) / shape[0] if state[0] else 0.0
        # exact for a path without reversal between two samples, so the rate does not matter
        way = 1.0 if moved > 0.0 else -1.0
        state[2] = way + (state[2] - way) * np.exp(-abs(moved))
        state[0], state[1] = 1.0, travel
        rows[i, 0] = state[2]


class Presliding(Remembering):
    """Friction that builds up over a short travel after each reversal.

    Equation: torque = F z; dz / d travel = (1 - z sign(d travel)) / reach, z = 0 at the start. F in
    N m, reach in rad.

    Check: reverse with very small amplitudes and plot torque against travel.

    Source: Dahl 1968, "A solid friction model", with exponent 1.
    """

    id = "hysteresis.presliding"
    balances = LOSS
    roles: ClassVar = {"travel": "spindle_angle_rad"}
    amplitudes = (Parameter("friction", "target", "loss in sliding", lower=0.0),)
    shape = (Parameter("reach", "travel", "travel to reach 63 %", 1e-3, 1e1),)
    walk = _walk
    rest = (0.0, 0.0, 0.0)
    told_apart_by = "reversals of very small amplitude, and the same ten times slower"
