"""Bouc-Wen hysteresis: a force with a smooth hysteresis loop over travel."""

from typing import ClassVar

import numba

from estimation.effects.effect import Parameter, Parameters, Remembering
from estimation.effects.transmission_relaxation import SETTLED
from estimation.recording import FloatArray

STEP, SATED = 0.5, 8.0
"""Longest step of the integration, and the travel after which it slides, in units of reach."""


@numba.njit(cache=True)
def power(size: float, sharpness: float) -> float:
    """Return size^sharpness; by products for 1, 2 and 4, several times faster than a power."""
    if sharpness == 1.0:
        return size
    if sharpness == 2.0:
        return size * size
    if sharpness == 4.0:
        return size * size * size * size
    return float(size**sharpness)


@numba.njit(cache=True)
def slope(z: float, way: float, sharpness: float) -> float:
    """Return dz / d travel in units of reach: 1 in unloading, 1 - |z|^sharpness in loading."""
    return 1.0 - power(abs(z), sharpness) if z * way > 0.0 else 1.0


@numba.njit(cache=True)
def follow(z: float, moved: float, sharpness: float) -> float:
    """Return z after a travel without reversal, in units of reach (classic Runge-Kutta method)."""
    if abs(moved) > SATED:
        return 1.0 if moved > 0.0 else -1.0
    pieces = int(abs(moved) / STEP) + 1
    piece = moved / pieces
    for _ in range(pieces):
        first = slope(z, piece, sharpness)
        second = slope(z + 0.5 * piece * first, piece, sharpness)
        third = slope(z + 0.5 * piece * second, piece, sharpness)
        last = slope(z + piece * third, piece, sharpness)
        z += piece * (first + 2.0 * second + 2.0 * third + last) / 6.0
        z = min(max(z, -1.0), 1.0)
    return z


@numba.njit(cache=True)
def walk_loop(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), the last travel, the hysteretic part -1 to 1."""
    for i in range(len(now)):
        moved = (now[i, 0] - state[1]) / shape[0] if state[0] else 0.0
        state[0], state[1] = 1.0, now[i, 0]
        if moved != 0.0:
            state[2] = follow(state[2], moved, shape[1])
        rows[i, 0] = state[2]


class BoucWen(Remembering):
    """Hysteresis with rounded corners, such as of rubbing wires or of a rubber mount.

    Equation: torque = F z; dz / d travel = (1 - |z|^n (1 + sign(z d travel)) / 2) / reach, z = 0 at
    the start. F in N m, reach in rad, n is the sharpness without unit.

    Check: reverse the motion with decreasing amplitude and plot torque against travel.

    Source: Bouc 1967 and Wen 1976, "Method for random vibration of hysteretic systems", with beta =
    gamma.
    """

    id = "hysteresis.bouc_wen"
    balances: ClassVar = {"motor": -1, "cable": 1, "stretch": -1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"travel": "spindle_angle_rad"}
    amplitudes = (Parameter("friction", "target", "half the height of the loop", lower=0.0),)
    shape: ClassVar[Parameters] = (
        Parameter("reach", "travel", "travel from middle to end of loop", 1e-3, 10.0, points=12),
        Parameter("sharpness", "1", "sharpness of the corners", 1.0, 4.0, points=3),
    )
    walk = walk_loop
    rest = (0.0, 0.0, 0.0)
    told_apart_by = "reversals of shrinking amplitude, one inside the other"


@numba.njit(cache=True)
def walk_from_load(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows of a loop that begins on the single loading from `settled` of the first load.

    The state is that of `walk_loop`.
    """
    if not state[0]:
        state[0], state[1] = 1.0, shape[2] * now[0, 0]
    walk_loop(now, shape, state, rows)


class Twist(BoucWen):
    """The part of a cable's or a shaft's deflection that is delayed by rubbing wires.

    Equation: deflection lost = F z; dz / d load = (1 - |z|^n (1 + sign(z d load)) / 2) / reach. F
    in rad, reach in N m, n is the sharpness without unit. At the start of a run the loop is that of
    a single loading from `settled` times the first load, where z = 0.

    Check: load slowly up and down with growing and decreasing amplitude and plot deflection against
    load.

    Source: Bouc 1967 and Wen 1976, "Method for random vibration of hysteretic systems", with beta =
    gamma, the load in the place of the deflection.
    """

    id = "hysteresis.bouc_wen.twist"
    meaning = "a deflection with a smooth hysteresis loop over the load"
    balances: ClassVar = {"gearbox": -1, "stretch": 1}
    roles: ClassVar = {"load": "distal_torque_n_m"}
    amplitudes = (Parameter("lost", "target", "half the width of the loop", lower=0.0),)
    shape = (
        Parameter("reach", "load", "load from middle to end of loop", 1e-3, 1.0, points=9),
        Parameter("sharpness", "1", "sharpness of the corners", 1.0, 4.0, points=3),
        SETTLED,
    )
    walk = walk_from_load
    told_apart_by = "loads of slowly growing and shrinking amplitude, and the same ten times slower"
