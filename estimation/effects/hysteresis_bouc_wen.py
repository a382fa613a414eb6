"""Hysteresis after Bouc and Wen: a force that follows travel in a loop with rounded corners."""

from typing import ClassVar

import numba

from estimation.effects.effect import Parameter, Remembering
from estimation.recording import FloatArray

STEP, SATED = 0.5, 8.0
"""Longest piece of a path integrated at once, and a path after which it slides, in reaches."""


@numba.njit(cache=True)
def power(size: float, sharpness: float) -> float:
    """Return size^sharpness; the grid's three by products, several times faster than a power."""
    if sharpness == 1.0:
        return size
    if sharpness == 2.0:
        return size * size
    if sharpness == 4.0:
        return size * size * size * size
    return float(size**sharpness)


@numba.njit(cache=True)
def slope(z: float, way: float, sharpness: float) -> float:
    """Return dz along the way: 1 while it unloads, 1 - |z|^sharpness while it loads."""
    return 1.0 - power(abs(z), sharpness) if z * way > 0.0 else 1.0


@numba.njit(cache=True)
def follow(z: float, moved: float, sharpness: float) -> float:
    """Return z after a path without reversal, `moved` in reaches (classic Runge-Kutta rule)."""
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
    """Walk; state: whether a sample has come, the last travel, the hysteretic part -1 to 1."""
    for i in range(len(now)):
        moved = (now[i, 0] - state[1]) / shape[0] if state[0] else 0.0
        state[0], state[1] = 1.0, now[i, 0]
        if moved != 0.0:
            state[2] = follow(state[2], moved, shape[1])
        rows[i, 0] = state[2]


class BoucWen(Remembering):
    """A loop that opens with travel: wires that rub on each other, a rubber mount.

    Equation: torque = F z; dz / d travel = (1 - |z|^n (1 + sign(z d travel)) / 2) / reach, n being
    the sharpness, z = 0 at the start.

    Source: Bouc 1967 and Wen 1976, "Method for random vibration of hysteretic systems", with
    beta = gamma.
    """

    id = "hysteresis.bouc_wen"
    balances: ClassVar = {"motor": -1, "cable": 1, "stretch": -1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"travel": "spindle_angle_rad"}
    amplitudes = (Parameter("friction", "target", "half the height of the loop", lower=0.0),)
    shape = (
        Parameter("reach", "travel", "way from loop's middle to its end", 1e-3, 10.0, points=12),
        Parameter("sharpness", "1", "how sharp its corners are", 1.0, 4.0, points=3),
    )
    walk = walk_loop
    rest = (0.0, 0.0, 0.0)
    confused_with = ("hysteresis.presliding", "friction.coulomb", "transmission.backlash")
    told_apart_by = "reversals of shrinking amplitude, one inside the other"
