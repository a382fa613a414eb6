"""Friction of a loaded plain bearing: in proportion to what is left behind it, and it lets go."""

import math
from typing import ClassVar

import numba

from estimation.effects.effect import Parameter, Remembering
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Walk; state: whether a sample has come, last travel, last time, bristle."""
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
    """A wrist's bearing: it loses a share of the load behind it, and held, lets go of some of that.

    Equation: load = drive / (1 + m s): the loss is m s of what arrives, not of what is sent, so a
    bearing that loses the same share gives back more in opening than it takes in closing.
    ds = (sign(d travel) - s) |d travel| / reach - (s - kept sign s) dt / time where |s| > kept. The
    loss without load, the drag and what accelerates the moving parts are weighed alike.

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
        Parameter("gain", "target / axis_current", "load for a unit of drive", lower=0.0),
        Parameter("friction", "target", "loss without load, and the drive's zero"),
        Parameter("damping", "target / axis_speed", "drag for one unit of speed", lower=0.0),
        Parameter("inertia", "target / axis_acceleration", "what accelerates the parts", lower=0.0),
    )
    shape = (
        Parameter("share", "1", "loss for a unit of load", 0.03, 0.9, points=4),
        Parameter(
            "reach", "axis_angle", "way after which 63 % of it is there", 1e-3, 1e-1, points=3
        ),
        Parameter("time", "clock", "time after which 63 % of that is gone", 0.5, 30.0, points=3),
        Parameter("kept", "1", "share that stays while it is held", 0.2, 0.98, points=3),
    )
    walk = _walk
    rest = (0.0, 0.0, 0.0, 0.0)
    at_rest = True
    confused_with = (
        "friction.load_viscous",
        "friction.position",
        "friction.coulomb",
        "friction.drag",
        "hysteresis.presliding",
        "sensor.lag",
    )
    told_apart_by = "holds of two and of thirty seconds at several loads"
