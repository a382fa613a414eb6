"""The limits held against every sample while armed, the twin of `firmware/core/limits.hpp`."""

import numba
import numpy as np
from numpy.typing import NDArray

MAX_CURRENT, MAX_LOAD_MA, MAX_PROXIMAL, MAX_DISTAL, MIN_SPINDLE, MAX_SPINDLE = range(6)
"""Places in the limits, shape (6,), int32, counts."""


@numba.njit(cache=True)
def beyond_limits(
    limits: NDArray[np.int32], spindle: int, proximal: int, distal: int, current: int
) -> bool:
    """Return whether a sample's inputs, in counts, are beyond `limits`."""
    return bool(
        not -limits[MAX_CURRENT] <= current <= limits[MAX_CURRENT]
        or not -limits[MAX_PROXIMAL] <= proximal <= limits[MAX_PROXIMAL]
        or not -limits[MAX_DISTAL] <= distal <= limits[MAX_DISTAL]
        or not limits[MIN_SPINDLE] <= spindle <= limits[MAX_SPINDLE]
    )


@numba.njit(cache=True)
def first_breach(limits: NDArray[np.int32], counts: NDArray[np.int32]) -> int:
    """Return the first row of `counts`, shape (n, 9), beyond `limits`, or n when there is none."""
    ticks = len(counts)
    for tick in range(ticks):
        _, spindle, _, proximal, distal, current = counts[tick, :6]
        if beyond_limits(limits, spindle, proximal, distal, current):
            return tick
    return ticks
