"""Hysteresis after Bouc and Wen: a force that follows travel in a loop with rounded corners."""

from typing import ClassVar

import numba

from estimation.effects.effect import Parameter, Remembering
from estimation.recording import FloatArray

STEP, STEPS = 0.05, 200
"""Longest piece of a path integrated at once, in reaches, and most pieces; ten reaches sate it."""


@numba.njit(cache=True)
def slope(z: float, way: float, sharpness: float) -> float:
    """Return dz along the way: 1 while it unloads, 1 - |z|^sharpness while it loads."""
    return 1.0 - abs(z) ** sharpness if z * way > 0.0 else 1.0


@numba.njit(cache=True)
def follow(z: float, moved: float, sharpness: float) -> float:
    """Return z after a path without reversal, `moved` in reaches (midpoint rule)."""
    pieces = min(int(abs(moved) / STEP) + 1, STEPS)
    piece = min(max(moved, -STEP * STEPS), STEP * STEPS) / pieces
    for _ in range(pieces):
        middle = z + 0.5 * piece * slope(z, piece, sharpness)
        z = min(max(z + piece * slope(middle, piece, sharpness), -1.0), 1.0)
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
    balances: ClassVar = {"motor": -1, "cable": 1, "stretch": 1, "grasp": -1, "joint": 1}
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
