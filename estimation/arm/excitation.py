"""Finite Fourier series that excite an arm's parameters, with bounds valid at every instant.

Equation 2.14 of G. A. Piqué's thesis, five harmonics of 0.1 Hz; the condition number of the
regressor with columns of unit length (equation 2.15) is the criterion. The thesis (section 2.4)
minimises it by an active-set method (sequential quadratic programming) with the limits as
constraints at sampled instants; between those nothing holds them. Ours goes on from there: every
trial is scaled into bounds that hold at every instant before it is judged, so the search needs no
constraints.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import LinearConstraint, minimize

from estimation.arm.base import base_of
from estimation.arm.motion import Motion
from estimation.arm.regressor import regressor
from estimation.arm.tables import Arm
from estimation.recording import FloatArray

HARMONICS = 5
FUNDAMENTAL_HZ = 0.1
PULSE = 2 * np.pi * FUNDAMENTAL_HZ * np.arange(1.0, HARMONICS + 1)
GRID = 2000
"""Instants of a period at which limits are looked at; between them the series' slope bounds it."""

JUDGED = 80
"""Instants at which the regressor is computed; with more, its condition number barely changes."""

LEAST_GAIN = 0.01
"""Logarithm by which a search must lower the condition for another one to begin."""

SAMPLED = 20
"""Instants of a period at which the limits are constraints."""

ACCELERATION_PER_SPEED = 4.0
"""Limit of acceleration, as a multiple of the speed limit, 1/s; assumed, the thesis states none."""


@dataclass(frozen=True)
class Excitation:
    """A periodic motion of every joint."""

    middle: FloatArray  # shape (joints,), rad or m
    sine: FloatArray  # amplitudes of position's sines, shape (harmonics, joints)
    cosine: FloatArray  # of its cosines

    def motion(self, time_s: FloatArray) -> Motion:
        """Return the motion at instants that are evenly spaced."""
        position, velocity, acceleration = (
            _series(self.sine, self.cosine, time_s, order) for order in range(3)
        )
        period = float(time_s[1] - time_s[0])
        return Motion(self.middle + position, velocity, acceleration, period)


def _series(sine: FloatArray, cosine: FloatArray, time_s: FloatArray, order: int) -> FloatArray:
    phase = np.outer(time_s, PULSE) + order * np.pi / 2
    scale = (PULSE**order)[:, None]
    return np.sin(phase) @ (scale * sine) + np.cos(phase) @ (scale * cosine)


def _limits(arm: Arm) -> tuple[FloatArray, FloatArray]:
    """Return the middle of each joint's range, and limits of position, velocity, acceleration.

    Shape (joints,) and (3, joints); the first limit is half the range.
    """
    lower, upper, speed = arm.limits
    limits = np.stack([(upper - lower) / 2, speed, ACCELERATION_PER_SPEED * speed])
    return (lower + upper) / 2, limits


def bounds(sine: FloatArray, cosine: FloatArray) -> FloatArray:
    """Return bounds that hold at every instant: of position, velocity, acceleration; (3, joints).

    Between two instants a series differs from the nearer one by at most half the step times the
    bound of its slope, the sum of its amplitudes.
    """
    time = np.arange(GRID) / (GRID * FUNDAMENTAL_HZ)
    amplitude = np.hypot(sine, cosine)
    rows = []
    for order in range(3):
        slope = (PULSE ** (order + 1)) @ amplitude
        seen = np.abs(_series(sine, cosine, time, order)).max(axis=0)
        rows.append(seen + slope * time[1] / 2)
    return np.stack(rows)


def reached(arm: Arm, excitation: Excitation) -> float:
    """Return a bound that holds at every instant of the largest share of any limit used.

    Up to 1 no limit of position, velocity or acceleration is passed, whatever the instant.
    """
    middle, limits = _limits(arm)
    moved = bounds(excitation.sine, excitation.cosine)
    moved[0] += np.abs(excitation.middle - middle)
    return float((moved / limits).max())


def fitted(arm: Arm, raw: FloatArray) -> Excitation:
    """Scale numbers without limits into an excitation within the arm's limits.

    They are sines, cosines, and how the range is shared between middle and swing: shape (joints x
    (2 harmonics + 1),).
    """
    joints = len(arm.joints)
    table = raw.reshape(2 * HARMONICS + 1, joints)
    sine, cosine = table[:HARMONICS], table[HARMONICS:-1]
    middle, limits = _limits(arm)
    off_centre = 0.5 * np.tanh(table[-1]) * limits[0]
    limits[0] -= np.abs(off_centre)
    factor = (limits / np.maximum(bounds(sine, cosine), 1e-12)).min(axis=0)
    return Excitation(middle + off_centre, factor * sine, factor * cosine)


def numbers_of(arm: Arm, excitation: Excitation) -> FloatArray:
    """Return the numbers that `fitted` makes an excitation of the same form from.

    A middle more than a quarter of the range off the centre comes nearer to it.
    """
    middle, limits = _limits(arm)
    off_centre = (excitation.middle - middle) / (0.5 * limits[0])
    share = np.arctanh(np.clip(off_centre, -0.99, 0.99))
    return np.concatenate([excitation.sine, excitation.cosine, share[None]]).ravel()


def condition(arm: Arm, excitation: Excitation) -> float:
    """Return the condition number of the base regressor with columns of unit length."""
    time = np.arange(JUDGED) / (JUDGED * FUNDAMENTAL_HZ)
    table = regressor(arm, excitation.motion(time))[:, :, base_of(arm).columns]
    stacked = table.reshape(-1, table.shape[2])
    length = np.linalg.norm(stacked, axis=0)
    singular = np.linalg.svd(stacked / np.where(length > 0, length, 1.0), compute_uv=False)
    return float(singular[0] / max(singular[-1], 1e-300))


def start(arm: Arm, seed: int) -> FloatArray:
    """Return a random start of the search."""
    rng = np.random.default_rng(seed)
    weight = 1 / np.arange(1.0, HARMONICS + 1)[:, None]
    shape = (HARMONICS, len(arm.joints))
    parts = [weight * rng.normal(size=shape), weight * rng.normal(size=shape)]
    return np.concatenate([*parts, 0.3 * rng.normal(size=(1, shape[1]))]).ravel()


def by_active_set(arm: Arm, first: Excitation, evaluations: int) -> Excitation:
    """Improve an excitation within the limits, which hold at sampled instants.

    `evaluations` is how many condition numbers it may take, gradients by differences included.
    """
    middle, limits = _limits(arm)
    time = np.arange(SAMPLED) / (SAMPLED * FUNDAMENTAL_HZ)

    def excitation(flat: FloatArray) -> Excitation:
        table = flat.reshape(2 * HARMONICS + 1, -1) * limits[0]
        return Excitation(table[-1], table[:HARMONICS], table[HARMONICS:-1])

    def room(flat: FloatArray) -> FloatArray:
        """Return the margin to each limit, relative to it; not negative within the limits."""
        motion = excitation(flat).motion(time)
        moved = np.stack([motion.position - middle, motion.velocity, motion.acceleration])
        share = moved / limits[:, None]
        return np.concatenate([(1 - share).ravel(), (1 + share).ravel()])

    begin = np.concatenate([first.sine, first.cosine, first.middle[None]]) / limits[0]
    nothing = room(np.zeros(begin.size))
    # the limits are linear in the coefficients
    linear = np.stack([room(unit) - nothing for unit in np.eye(begin.size)], axis=1)

    def logarithm(flat: FloatArray) -> float:
        return float(np.log(condition(arm, excitation(flat))))

    found = minimize(
        logarithm,
        begin.ravel(),
        method="SLSQP",
        tol=1e-6,
        constraints=LinearConstraint(linear, -nothing, np.inf),
        options={"maxiter": max(1, evaluations // (begin.size + 2))},
    )
    return excitation(found.x)


def improved(arm: Arm, first: Excitation, evaluations: int) -> Excitation:
    """Improve an excitation, within the limits or not, to one within them at every instant.

    `evaluations` are those of `by_active_set`.
    """
    raw = numbers_of(arm, first)
    lowest, best = np.inf, raw
    before, left = np.inf, max(1, evaluations // (raw.size + 2))

    def logarithm(trial: FloatArray) -> float:
        nonlocal lowest, best
        value = float(np.log(condition(arm, fitted(arm, trial))))
        if value < lowest:
            lowest, best = value, trial.copy()
        return value

    # the criterion ignores scale, so a search may step far away and stop there: it begins again
    # from the best trial while that helps
    while left > 0 and (lowest == np.inf or lowest < before - LEAST_GAIN):
        before, begin = lowest, numbers_of(arm, fitted(arm, best))
        found = minimize(logarithm, begin, method="SLSQP", tol=1e-6, options={"maxiter": left})
        left -= max(1, found.nit)
    return fitted(arm, best)
