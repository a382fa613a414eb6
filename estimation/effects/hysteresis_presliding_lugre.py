"""Presliding (LuGre): a contact that deflects before it slides, with less friction at speed."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import Parameter, Remembering
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), the last travel, the bend / that of fast sliding."""
    for i in range(len(now)):
        travel, speed = now[i, 0], now[i, 1]
        limit = 1.0 + shape[1] * np.exp(-((speed / shape[2]) ** 2))
        moved = (travel - state[1]) / shape[0] if state[0] else 0.0
        # exact for a path without reversal and a limit that holds between two samples
        way = limit if moved > 0.0 else -limit
        state[2] = way + (state[2] - way) * np.exp(-abs(moved) / limit)
        state[0], state[1] = 1.0, travel
        rows[i, 0] = state[2]


class LuGre(Remembering):
    """Friction that builds up over a short travel, to a level that decreases with speed.

    Equation: torque = F z; dz / d travel = (1 - z sign(d travel) / g) / reach, g = 1 + rise
    exp(-(speed / fall)^2), z = 0 at the start. F in N m, reach in rad, fall in rad/s, rise without
    unit. The damping of the bristles and the viscous part are separate effects.

    Check: reverse with very small amplitudes, and run at several slow constant speeds.

    Source: Canudas de Wit, Olsson, Astrom and Lischinsky 1995, equations 2, 3 and 5.
    """

    id = "hysteresis.presliding.lugre"
    family = "hysteresis.presliding"
    balances: ClassVar = {"motor": -1, "cable": 1, "stretch": -1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"travel": "spindle_angle_rad", "speed": "motor_velocity_rad_s"}
    amplitudes = (Parameter("friction", "target", "loss in fast sliding", lower=0.0),)
    shape = (
        Parameter("reach", "travel", "travel to reach 63 %", 1e-3, 10.0, points=6),
        Parameter("rise", "1", "relative increase at low speed", 0.1, 3.0, points=2),
        Parameter("fall", "speed", "speed at which 37 % of the rise remains", 1e-2, 50.0, points=3),
    )
    walk = _walk
    rest = (0.0, 0.0, 0.0)
    told_apart_by = "reversals of very small amplitude, and a staircase of slow speeds"
