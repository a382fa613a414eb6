"""Friction of a plain bearing: it drags, it holds after Dahl, and lets go of a share with time."""

import math
from typing import ClassVar

import numba

from estimation.effects.effect import Parameter, Remembering
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Walk; state: whether a sample has come, last travel, last time, deflection, what is held."""
    for i in range(len(now)):
        travel, load, time_s = now[i, 0], abs(now[i, 1]), now[i, 2]
        if state[0]:
            moved = (travel - state[1]) / shape[0]
            way = 1.0 if moved > 0.0 else -1.0
            bent = way + (state[3] - way) * math.exp(-abs(moved))
            kept = math.exp(-(time_s - state[2]) / shape[1])
            state[4] = state[4] * kept + bent - state[3]
            state[3] = bent
        state[0], state[1], state[2] = 1.0, travel, time_s
        rows[i, 0] = state[3]
        rows[i, 1] = load * state[3]
        rows[i, 2] = state[4]
        rows[i, 3] = load * state[4]
        rows[i, 4] = now[i, 3]


class BearingFriction(Remembering):
    """Friction that stays when the motion ends, and of which a share is let go of with time.

    Unlike the effects of friction in motion it says what is held at rest; its drag is part of it.

    Equation: torque = (F1 + m1 |load|) z + (F2 + m2 |load|) y + b speed; dz / d travel = (1 - z
    sign(d travel)) / reach; y is z without what it forgets, y' = z' - y / time.

    Source: z after Dahl 1968, "A solid friction model", exponent 1; the decay of the estimate while
    a grasp is held is shown in Zhao and Nelson 2016, Figures 11 and 12, which leave it unmodelled.
    """

    id = "hysteresis.bearing"
    roles: ClassVar = {
        "travel": "spindle_angle_rad",
        "load": "motor_current_a",
        "clock": "time_s",
        "speed": "motor_velocity_rad_s",
    }
    amplitudes = (
        Parameter("friction", "target", "loss that stays", lower=0.0),
        Parameter("load_friction", "target / load", "the same for a unit of load", lower=0.0),
        Parameter("let_go", "target", "loss that is let go of", lower=0.0),
        Parameter("load_let_go", "target / load", "the same for a unit of load", lower=0.0),
        Parameter("damping", "target / speed", "drag for one unit of speed", lower=0.0),
    )
    shape = (
        Parameter("reach", "travel", "way after which 63 % of it is there", 1e-3, 1e0),
        Parameter("time", "clock", "time after which 63 % of it is let go of", 3e-1, 3e1),
    )
    walk = _walk
    rest = (0.0, 0.0, 0.0, 0.0, 0.0)
    confused_with = ("hysteresis.presliding", "friction.load", "sensor.creep")
    told_apart_by = "holds of two and of thirty seconds at several loads"
