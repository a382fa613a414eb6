"""Dwell friction: static friction that grows with the time at standstill."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import Parameter, Remembering
from estimation.recording import FloatArray


@numba.njit(cache=True)
def aged(state: float, speed: float, step_s: float, time_s: float, way: float) -> float:
    """Return the state of a contact, 0 to 1, after a step; exact for a speed that holds in it."""
    growth, wear = 1.0 / time_s, abs(speed) / way
    settled = growth / (growth + wear)
    return float(settled + (state - settled) * np.exp(-(growth + wear) * step_s))


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), its time, what the contact has grown (0 to 1)."""
    for i in range(len(now)):
        speed, clock = now[i, 0], now[i, 1]
        if state[0]:
            state[2] = aged(state[2], speed, clock - state[1], shape[0], shape[1])
        state[0], state[1] = 1.0, clock
        rows[i, 0] = state[2] * np.tanh(speed / shape[2])


class Dwell(Remembering):
    """Break-away friction that depends on the time at standstill before it.

    Equation: torque = F z tanh(speed / width); dz/dt = (1 - z) / time - z |speed| / way. F in N m,
    width in rad/s, time in s, way in rad; z is the state of the contact, 0 to 1. A run starts after
    a long standstill: z = 1.

    Check: repeat the same motion after pauses of several lengths.

    Source: Dieterich 1979 and Ruina 1983 (the ageing law of rate-and-state friction), with a state
    that is bounded.
    """

    id = "friction.dwell"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "clock": "time_s"}
    amplitudes = (Parameter("friction", "target", "loss after a long rest", lower=0.0),)
    shape = (
        Parameter("time", "clock", "standstill to reach 63 %", 0.1, 10.0, points=3),
        Parameter("way", "speed * clock", "slip after which 37 % remains", 1e-3, 1e3, points=7),
        Parameter("width", "speed", "speed at which friction reaches 76 %", 0.05, 20.0, points=3),
    )
    walk = _walk
    rest = (0.0, 0.0, 1.0)
    told_apart_by = "the same motion after pauses of several lengths"
