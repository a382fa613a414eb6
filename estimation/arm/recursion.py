"""The links' torque regressor along a whole motion, compiled: one recursion from the base outwards.

A torque is linear in a link's mass, first moments and inertia about its joint's origin (W. Khalil
and E. Dombre, Modeling, Identification and Control of Robots, 2002, chapter 9). Pinocchio computes
the same columns sample by sample and is the reference in the tests; called from Python 5000 times
it costs several times as much as its own work.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin

import numba
import numpy as np
from numpy.typing import NDArray

from estimation.arm.tables import Body, DhRow
from estimation.recording import FloatArray

LINK = ("m", "lx", "ly", "lz", "Lxx", "Lxy", "Lyy", "Lxz", "Lyz", "Lzz")
"""A link's parameters in Pinocchio's order: kg, kg m, kg m^2; about the joint's origin."""

COUNTING = {"full": slice(0, 10), "first moments": slice(1, 4), "thin": slice(0, 2)}
"""Which of them count, by the kind of link in a body's table."""


@dataclass(frozen=True)
class Tree:
    """A tree of bodies, each on one joint along or about its own z axis."""

    parents: NDArray[np.int64]  # parent of each body, -1 for the base; parents first
    prismatic: NDArray[np.bool_]  # whether the joint of each body is prismatic
    turns: FloatArray  # each joint's frame in its parent's at q = 0, (bodies, 3, 3)
    places: FloatArray  # its origin there, shape (bodies, 3), m
    gravity: FloatArray  # in the base frame, shape (3,), m/s^2

    @classmethod
    def of(cls, bodies: Sequence[Body], gravity_m_s2: tuple[float, float, float]) -> "Tree":
        """Lay out bodies on modified Denavit-Hartenberg rows."""
        return cls(
            np.array([body.parent - 1 for body in bodies], np.int64),
            np.array([body.prismatic for body in bodies], np.bool_),
            np.stack([_turn(body.row) for body in bodies]),
            np.stack([_place(body.row) for body in bodies]),
            np.array(gravity_m_s2),
        )


def _turn(row: DhRow) -> FloatArray:
    ca, sa, ct, st = cos(row.alpha_rad), sin(row.alpha_rad), cos(row.theta_rad), sin(row.theta_rad)
    return np.array([[ct, -st, 0.0], [ca * st, ca * ct, -sa], [sa * st, sa * ct, ca]])


def _place(row: DhRow) -> FloatArray:
    return np.array([row.a_m, -sin(row.alpha_rad) * row.d_m, cos(row.alpha_rad) * row.d_m])


def fill_links(
    tree: Tree,
    motion: tuple[FloatArray, FloatArray, FloatArray],
    to: NDArray[np.int64],
    table: FloatArray,
) -> None:
    """Write the links' columns of a motion into a table of zeros, shape (n, bodies, columns).

    The motion is positions, velocities and accelerations of the bodies' joints, (n, bodies) each;
    `to` is the column of each body and parameter of `LINK`, -1 for none.
    """
    q, v, a = (np.ascontiguousarray(x, dtype=np.float64) for x in motion)
    frames = tree.parents, tree.prismatic, tree.turns, tree.places
    _fill(frames, tree.gravity, (q, v, a), to, table)


@numba.njit(cache=True, error_model="numpy")
def _fill(frames, gravity, motion, to, table):  # type: ignore[no-untyped-def]
    parents, prismatic, turns, places = frames
    q, v, a = motion
    bodies = len(parents)
    # the last row is the base, which rises against gravity: a parent of -1 points there
    spin, turning = np.zeros((bodies + 1, 3)), np.zeros((bodies + 1, 3))
    rising = np.zeros((bodies + 1, 3))
    rising[bodies] = -gravity
    # for every joint, relative to a body: its axis, and its axis times the lever to that body
    axes, levers = np.zeros((bodies, bodies, 3)), np.zeros((bodies, bodies, 3))
    turn = np.empty((3, 3))
    for i in range(bodies):
        axes[i, i, 2] = 0.0 if prismatic[i] else 1.0
        levers[i, i, 2] = 1.0 if prismatic[i] else 0.0
    for sample in range(len(q)):
        for i in range(bodies):
            p = parents[i]
            moved = q[sample, i]
            c, s = (1.0, 0.0) if prismatic[i] else (np.cos(moved), np.sin(moved))
            along = moved if prismatic[i] else 0.0
            for k in range(3):
                turn[k, 0] = turns[i, k, 0] * c + turns[i, k, 1] * s
                turn[k, 1] = turns[i, k, 1] * c - turns[i, k, 0] * s
                turn[k, 2] = turns[i, k, 2]
            place = (
                places[i, 0] + turn[0, 2] * along,
                places[i, 1] + turn[1, 2] * along,
                places[i, 2] + turn[2, 2] * along,
            )
            w, t, r = _vector(spin, p), _vector(turning, p), _vector(rising, p)
            inner = _sum(_cross(t, place), _cross(w, _cross(w, place)))
            w, t, r = _back(turn, w), _back(turn, t), _back(turn, _sum(r, inner))
            w, t, r = _moved(prismatic[i], v[sample, i], a[sample, i], w, t, r)
            for k in range(3):
                spin[i, k], turning[i, k], rising[i, k] = w[k], t[k], r[k]
            axis, lever = (0.0, 0.0, axes[i, i, 2]), (0.0, 0.0, levers[i, i, 2])
            _row(axis, lever, (w, t, r), to[i], table[sample, i])
            j = p
            while j >= 0:
                axis = (axes[p, j, 0], axes[p, j, 1], axes[p, j, 2])
                lever = (levers[p, j, 0], levers[p, j, 1], levers[p, j, 2])
                lever = _back(turn, _sum(lever, _cross(axis, place)))
                axis = _back(turn, axis)
                for k in range(3):
                    axes[i, j, k], levers[i, j, k] = axis[k], lever[k]
                _row(axis, lever, (w, t, r), to[i], table[sample, j])
                j = parents[j]


@numba.njit(cache=True, inline="always")
def _vector(rows, k):  # type: ignore[no-untyped-def]
    return rows[k, 0], rows[k, 1], rows[k, 2]


@numba.njit(cache=True, inline="always")
def _sum(x, y):  # type: ignore[no-untyped-def]
    return x[0] + y[0], x[1] + y[1], x[2] + y[2]


@numba.njit(cache=True, inline="always")
def _cross(x, y):  # type: ignore[no-untyped-def]
    return x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]


@numba.njit(cache=True, inline="always")
def _back(turn, x):  # type: ignore[no-untyped-def]
    """Return a vector of the parent's frame in the joint's own."""
    return (
        turn[0, 0] * x[0] + turn[1, 0] * x[1] + turn[2, 0] * x[2],
        turn[0, 1] * x[0] + turn[1, 1] * x[1] + turn[2, 1] * x[2],
        turn[0, 2] * x[0] + turn[1, 2] * x[1] + turn[2, 2] * x[2],
    )


@numba.njit(cache=True, inline="always")
def _moved(slides, v, a, w, t, r):  # type: ignore[no-untyped-def]
    """Add a joint's own motion to what its parent's gives it."""
    if slides:
        return w, t, (r[0] + 2 * w[1] * v, r[1] - 2 * w[0] * v, r[2] + a)
    return (w[0], w[1], w[2] + v), (t[0] + w[1] * v, t[1] - w[0] * v, t[2] + a), r


@numba.njit(cache=True, inline="always")
def _row(u, c, motion, to, row):  # type: ignore[no-untyped-def]
    """Write what each parameter of a link does on a joint: axis u . moment + lever c . force."""
    w, t, r = motion
    if to[0] >= 0:
        row[to[0]] = c[0] * r[0] + c[1] * r[1] + c[2] * r[2]
    cw = c[0] * w[0] + c[1] * w[1] + c[2] * w[2]
    ww = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    # force of a first moment l: t x l + w x (w x l); its moment: l x r
    ct, ru = _cross(c, t), _cross(r, u)
    for k in range(3):
        if to[1 + k] < 0:
            continue
        row[to[1 + k]] = ct[k] + cw * w[k] - ww * c[k] + ru[k]
    if to[4] < 0:
        return
    # moment of an inertia L: L t + w x L w
    s = _cross(u, w)
    row[to[4]] = u[0] * t[0] + s[0] * w[0]
    row[to[5]] = u[0] * t[1] + u[1] * t[0] + s[0] * w[1] + s[1] * w[0]
    row[to[6]] = u[1] * t[1] + s[1] * w[1]
    row[to[7]] = u[0] * t[2] + u[2] * t[0] + s[0] * w[2] + s[2] * w[0]
    row[to[8]] = u[1] * t[2] + u[2] * t[1] + s[1] * w[2] + s[2] * w[1]
    row[to[9]] = u[2] * t[2] + s[2] * w[2]
