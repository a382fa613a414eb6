"""Elements that effects are built of: slip, creep and hats, each linear in its strength.

Hysteresis is a sum of elastic-slip elements (Maxwell slip): each follows the motion until its
spring slips, so with the thresholds fixed it is linear in its strengths. F. Al-Bender, V. Lampaert,
J. Swevers, "The generalized Maxwell-slip model", IEEE T-AC 50(11), 2005.
"""

import numba
import numpy as np
from scipy import signal

from estimation.recording import FloatArray


def slip(position: FloatArray, threshold: float) -> FloatArray:
    """Return the deflection of elastic-slip elements, relative to that at which they slip.

    Positions are of shape (n, drives), the threshold is in their unit. The elements start relaxed,
    so what they give is history-free only after each has slipped once.
    """
    return np.asarray(_stretch(np.ascontiguousarray(position), threshold) / threshold)


@numba.njit(cache=True)
def _stretch(position, threshold):  # type: ignore[no-untyped-def]
    stretch = np.zeros_like(position)
    for k in range(1, len(position)):
        for j in range(position.shape[1]):
            moved = stretch[k - 1, j] + position[k, j] - position[k - 1, j]
            stretch[k, j] = min(max(moved, -threshold), threshold)
    return stretch


def creep(velocity: FloatArray, time_constant_s: float, period_s: float) -> FloatArray:
    """Return the velocity of a damper in series with a spring (a Maxwell element), 0 at the start.

    Its time constant is damping over stiffness; the velocity is of shape (n, ...).
    """
    kept = np.exp(-period_s / time_constant_s)
    return signal.lfilter([1 - kept], [1, -kept], velocity, axis=0)


def hats(position: FloatArray, lower: float, upper: float, count: int) -> FloatArray:
    """Return a piecewise linear function's columns at positions (n,), shape (n, count).

    Its knots are evenly spaced from `lower` to `upper`; the ends go on flat.
    """
    knots = np.linspace(lower, upper, count)
    inside = np.clip(position, lower, upper)[:, None]
    return np.asarray(np.clip(1 - np.abs(inside - knots) / (knots[1] - knots[0]), 0, 1))
