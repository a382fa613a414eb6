"""Load-dependent friction: friction proportional to the load."""

import math
from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import (
    Inputs,
    Parameter,
    Parameters,
    Pointwise,
    Remembering,
    Row,
    Shape,
)
from estimation.effects.memory import REST, SHAPE, advance
from estimation.recording import FloatArray


class LoadFriction(Pointwise):
    """Friction of teeth or of a wrapped cable that grows with the transmitted load.

    Equation: torque = mu |load| tanh(speed / width), load in N m, width in rad/s, mu without unit.

    Check: repeat the same motion with a soft and a stiff object, and free; inspect teeth and cable
    guides.

    Source: Bittencourt and Gunnarsson 2012 (static friction of a robot joint with load).
    """

    id = "friction.load"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "load": "motor_load_n_m"}
    amplitudes = (Parameter("friction", "target / load", "loss per unit of load", lower=0.0),)
    shape: ClassVar[Parameters] = (
        Parameter("width", "speed", "speed at which friction reaches 76 %", 1e-3, 1e2),
    )
    told_apart_by = "the same motion against two stiffnesses, and free"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (np.abs(inputs["load"]) * np.tanh(inputs["speed"] / shape[0]),)


@numba.njit(cache=True)
def _walk_bearing(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
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
    meaning = "friction of a bearing in proportion to its load, part of which relaxes at standstill"
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
    walk = _walk_bearing
    rest = (0.0, 0.0, 0.0, 0.0)
    at_rest = True
    told_apart_by = "holds of two and of thirty seconds at several loads"


UNIT_LOAD = 0.1
"""Reference load of the power law, N m or N: there the loss is mu times the load."""


class PowerLoadFriction(LoadFriction):
    """Friction that is not proportional to the load: contacts that flatten, or teeth that seat.

    Equation: torque = mu L (|load| / L)^exponent tanh(speed / width), L = 0.1 N m or, of a force,
    0.1 N, load in N m, width in rad/s, mu and exponent without unit.

    Check: repeat the same motion against three stiffnesses, and free.

    Source: Bowden and Tabor 1950 (friction as the area of contact: by Hertz's law the power 2/3 of
    the load for a single round contact, the least there is, and 1 for rough faces).
    """

    id = "friction.load.power"
    meaning = "friction that grows with a power of the load"
    balances: ClassVar = {"motor": -1, "cable": 1}
    amplitudes = (Parameter("friction", "target / load", "share of a load of 0.1", lower=0.0),)
    shape = (
        Parameter("exponent", "1", "power of the load", 2.0 / 3.0, 2.5, points=5),
        Parameter("width", "speed", "speed at which friction reaches 76 %", 1e-3, 1e2),
    )
    told_apart_by = "the same motion against three stiffnesses, and free"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        pressed = UNIT_LOAD * (np.abs(inputs["load"]) / UNIT_LOAD) ** shape[0]
        return (pressed * np.tanh(inputs["speed"] / shape[1]),)


@numba.njit(cache=True)
def _walk_sticking(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    for i in range(len(now)):
        acting = advance(now[i, 0], now[i, 1], shape, state)
        rows[i, 0], rows[i, 1] = acting, acting * abs(now[i, 1])


class StickingLoadFriction(Remembering):
    """Friction of teeth and cables, proportional to the transmitted torque, also at standstill.

    Equation: torque = (F + mu |drive|) z; dz = d drive / (limit + share |drive|) + (sign(d travel)
    - z) |d travel| / reach, -1 <= z <= 1. F in N m, drive and limit in the unit of the drive (A or
    N m), reach in rad, mu in N m per unit of drive, share without unit.

    Check: repeat the same motion at two loads with pauses; inspect teeth and cable guides.

    Source: Karnopp 1985 and Dahl 1968 for z; Bittencourt and Gunnarsson 2012 for friction that
    grows with load.
    """

    id = "friction.load.sticking"
    meaning = "friction proportional to the load, also at standstill"
    family = "friction.load"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"travel": "motor_angle_rad", "drive": "motor_current_a"}
    amplitudes = (
        Parameter("friction", "target", "loss without load"),
        Parameter("loss", "target / drive", "fraction of the drive that is lost", lower=0.0),
    )
    shape = SHAPE
    walk = _walk_sticking
    rest = REST
    at_rest = True
    told_apart_by = "the same motion at two loads, with pauses"
