"""Loaded plain bearing: friction proportional to the downstream load, with relaxation."""

import math
from typing import ClassVar

import numba

from estimation.effects.effect import Parameter, Remembering
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), last travel, last time, bristle."""
    share, reach, time, kept = shape[0], shape[1], shape[2], shape[3]
    for i in range(len(now)):
        travel, drive, time_s, speed = now[i, 0], now[i, 1], now[i, 2], now[i, 3]
        if state[0]:
            moved = travel - state[1]
            way = 1.0 if moved > 0.0 else -1.0
            state[3] = way + (state[3] - way) * math.exp(-abs(moved) / reach)
            side = 1.0 if state[3] > 0.0 else -1.0
            over = abs(state[3]) - kept
            if over > 0.0:
                state[3] = side * (kept + over * math.exp(-(time_s - state[2]) / time))
        state[0], state[1], state[2] = 1.0, travel, time_s
        passed = 1.0 / (1.0 + share * state[3])
        rows[i, 0] = drive * (1.0 - passed)
        rows[i, 1] = state[3] * passed
        rows[i, 2] = speed * passed
        rows[i, 3] = now[i, 4] * passed


class LoadedBearing(Remembering):
    """Friction of a wrist's plain bearing, proportional to its downstream load.

    Part of it relaxes while the joint is held.

    Equation: load = drive / (1 + m s). The friction is m s times the downstream load, so it is
    larger relative to the drive in opening than in closing. ds = (sign(d travel) - s) |d travel| /
    reach - (s - kept sign s) dt / time where |s| > kept. Friction without load, drag and inertia
    are divided by 1 + m s too. drive in A, load in N m, m without unit, reach in rad, time in s.

    Check: hold a grasp for thirty seconds and observe the decay of the current's estimate; inspect
    and lubricate the bearing.

    Source: Coulomb's law for a bearing under its own load; s after Dahl 1968; the decay of the
    estimate while a grasp is held is shown in Zhao and Nelson 2016, Figures 11 and 12.
    """

    id = "friction.load.bearing"
    family = "friction.load"
    balances: ClassVar = {"grasp": -1, "pitch": -1, "yaw": -1}
    roles: ClassVar = {
        "axis_angle": "grasp_angle_rad",
        "axis_current": "grasp_current_a",
        "clock": "time_s",
        "axis_speed": "grasp_velocity_rad_s",
        "axis_acceleration": "grasp_acceleration_rad_s2",
    }
    amplitudes = (
        Parameter("gain", "target / axis_current", "load per unit of drive", lower=0.0),
        Parameter("friction", "target", "loss without load, and the drive's zero"),
        Parameter("damping", "target / axis_speed", "drag per unit of speed", lower=0.0),
        Parameter("inertia", "target / axis_acceleration", "inertia of the parts", lower=0.0),
    )
    shape = (
        Parameter("share", "1", "loss per unit of load", 0.03, 0.9, points=4),
        Parameter("reach", "axis_angle", "travel to reach 63 %", 1e-3, 1e-1, points=3),
        Parameter("time", "clock", "time after which 63 % has decayed", 0.5, 30.0, points=3),
        Parameter("kept", "1", "fraction that remains while it is held", 0.2, 0.98, points=3),
    )
    walk = _walk
    rest = (0.0, 0.0, 0.0, 0.0)
    at_rest = True
    told_apart_by = "holds of two and of thirty seconds at several loads"
