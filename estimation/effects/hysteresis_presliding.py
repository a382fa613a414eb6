"""Presliding (Dahl): a contact that deflects elastically before it slides."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import LOSS, Parameter, Parameters, Remembering
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
    amplitudes: ClassVar[Parameters] = (
        Parameter("friction", "target", "loss in sliding", lower=0.0),
    )
    shape: ClassVar[Parameters] = (Parameter("reach", "travel", "travel to reach 63 %", 1e-3, 1e1),)
    walk = _walk
    rest: ClassVar[tuple[float, ...]] = (0.0, 0.0, 0.0)
    told_apart_by = "reversals of very small amplitude, and the same ten times slower"


@numba.njit(cache=True)
def _walk_lugre(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
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


class LuGre(Presliding):
    """Friction that builds up over a short travel, to a level that decreases with speed.

    Equation: torque = F z; dz / d travel = (1 - z sign(d travel) / g) / reach, g = 1 + rise
    exp(-(speed / fall)^2), z = 0 at the start. F in N m, reach in rad, fall in rad/s, rise without
    unit. The damping of the bristles and the viscous part are separate effects.

    Check: reverse with very small amplitudes, and run at several slow constant speeds.

    Source: Canudas de Wit, Olsson, Astrom and Lischinsky 1995, equations 2, 3 and 5.
    """

    id = "hysteresis.presliding.lugre"
    meaning = "friction that builds up over a short travel, to a level that falls with speed"
    balances: ClassVar = {"motor": -1, "cable": 1, "stretch": -1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"travel": "spindle_angle_rad", "speed": "motor_velocity_rad_s"}
    amplitudes = (Parameter("friction", "target", "loss in fast sliding", lower=0.0),)
    shape = (
        Parameter("reach", "travel", "travel to reach 63 %", 1e-3, 10.0, points=6),
        Parameter("rise", "1", "relative increase at low speed", 0.1, 3.0, points=2),
        Parameter("fall", "speed", "speed at which 37 % of the rise remains", 1e-2, 50.0, points=3),
    )
    walk = _walk_lugre
    told_apart_by = "reversals of very small amplitude, and a staircase of slow speeds"


SPREAD = (1.0, 3.0, 9.0)
"""Presliding distances of the elements, in units of the shortest."""


@numba.njit(cache=True)
def _walk_maxwell(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), the last travel, each element's bend / its limit."""
    for i in range(len(now)):
        moved = (now[i, 0] - state[1]) / shape[0] if state[0] else 0.0
        state[0], state[1] = 1.0, now[i, 0]
        for k in range(len(SPREAD)):
            state[2 + k] = min(max(state[2 + k] + moved / SPREAD[k], -1.0), 1.0)
            rows[i, k] = state[2 + k]


class MaxwellSlip(Presliding):
    """Parallel springs, each in series with a dry contact.

    Equation: torque = sum F_k z_k; z_k follows travel / (reach s_k) and stays within -1 and 1, s =
    1, 3, 9; z = 0 at the start. F_k in N m, reach in rad.

    Check: reverse with decreasing amplitude and plot torque against travel.

    Source: Lampaert, Al-Bender and Swevers 2003 (generalised Maxwell-slip model), its elements in
    quasi-static motion.
    """

    id = "hysteresis.presliding.maxwell"
    meaning = "friction that builds up over travels of several lengths"
    amplitudes = (
        Parameter("short", "target", "loss of the contact that slides first", lower=0.0),
        Parameter("middle", "target", "loss of the second contact", lower=0.0),
        Parameter("long", "target", "loss of the third contact", lower=0.0),
    )
    shape = (Parameter("reach", "travel", "travel until the first slides", 3e-4, 3.0, points=13),)
    walk = _walk_maxwell
    rest = (0.0, 0.0, 0.0, 0.0, 0.0)
    told_apart_by = "reversals of shrinking amplitude, and the same ten times slower"
