"""The lowest value of a window that moves along a signal."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimation.recording import FloatArray

ALIKE = 1e-9
"""Values that differ by less are alike where the place of the lowest matters. A filtered angle at
rest differs by its rounding, which is another one for samples one by one, in batches, or in C."""


def since_lowest(values: FloatArray, window: int) -> FloatArray:
    """Return each value less the lowest of itself and the `window - 1` before it."""
    return np.asarray(values - values[lowest(values, window)])


@njit(cache=True)
def lowest(values: FloatArray, window: int, alike: float = 0.0) -> NDArray[np.int64]:
    """Return the place of the lowest of each value and the `window - 1` before it.

    Of those that differ by no more than `alike` it is the last. Values that rise are kept in a
    queue, so each one is looked at twice at the most.
    """
    found = np.empty(len(values), np.int64)
    queue = np.empty(len(values), np.int64)
    first, end = 0, 0
    for i in range(len(values)):
        while end > first and values[queue[end - 1]] >= values[i] - alike:
            end -= 1
        queue[end] = i
        end += 1
        if queue[first] <= i - window:
            first += 1
        found[i] = queue[first]
    return found
