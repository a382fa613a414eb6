"""Dwell: friction that grows while a contact rests and is worn off by sliding."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import Parameter, Remembering
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Walk; state: whether a sample has come, its time, what the contact has grown (0 to 1)."""
    for i in range(len(now)):
        speed, clock = now[i, 0], now[i, 1]
        if state[0]:
            # exact for a speed that holds from one sample to the next
            growth, wear = 1.0 / shape[0], abs(speed) / shape[1]
            settled = growth / (growth + wear)
            fade = np.exp(-(growth + wear) * (clock - state[1]))
            state[2] = settled + (state[2] - settled) * fade
        state[0], state[1] = 1.0, clock
        rows[i, 0] = state[2] * np.tanh(speed / shape[2])


class Dwell(Remembering):
    """Break-away friction by the time of rest before it.

    Equation: torque = F z tanh(speed / width); dz/dt = (1 - z) / time - z |speed| / way. A run
    starts after a long rest: z = 1.

    Source: Dieterich 1979 and Ruina 1983 (the ageing law of rate-and-state friction), with a state
    that is bounded.
    """

    id = "friction.dwell"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "clock": "time_s"}
    amplitudes = (Parameter("friction", "target", "loss after a long rest", lower=0.0),)
    shape = (
        Parameter("time", "clock", "rest after which 63 % has grown", 0.1, 10.0, points=3),
        Parameter("way", "speed * clock", "slip after which 37 % is left", 0.01, 30.0, points=4),
        Parameter(
            "width", "speed", "speed at which 76 % of the direction is there", 0.05, 20.0, points=3
        ),
    )
    walk = _walk
    rest = (0.0, 0.0, 1.0)
    confused_with = ("friction.stribeck", "hysteresis.presliding", "friction.warmup")
    told_apart_by = "the same motion after rests of several lengths"
