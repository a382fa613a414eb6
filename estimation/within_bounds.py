"""Least squares within bounds from normal equations, for fits and for each of their replicates."""

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, optimize

from estimation.recording import FloatArray

LEAST_SHARE = 1e-12
"""Directions whose eigenvalue is a smaller share of the largest are not determined by the data."""


def solve_within(
    normal: FloatArray, right: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """Return the x, shape (n,), between `low` and `high` that has the least squared error.

    `normal`, shape (n, n), holds the products of the columns with one another, `right` those with
    the target. Where bounds are active the others are optimal conditional on them.
    """
    power = np.diag(normal)
    scale = np.sqrt(np.where(power > 0.0, power, 1.0))
    scaled, aim = normal / np.outer(scale, scale), right / scale
    free: FloatArray = linalg.lstsq(scaled, aim, check_finite=False)[0] / scale
    if np.all(free >= low) and np.all(free <= high):
        return free
    sizes, axes = linalg.eigh(scaled)
    kept = sizes > LEAST_SHARE * sizes[-1]
    roots = np.sqrt(sizes[kept])
    columns, target = roots[:, None] * axes[:, kept].T, (axes[:, kept].T @ aim) / roots
    found = optimize.lsq_linear(columns, target, (low * scale, high * scale), method="bvls")
    return np.clip(found.x / scale, low, high)


def solve_apart(
    normal: FloatArray,
    right: FloatArray,
    low: FloatArray,
    high: FloatArray,
    same: tuple[int, int] | None,
) -> FloatArray:
    """Return the x of `solve_within` where two columns may be the same.

    The second of them is zero; where the first is at its lower bound then, the first is.
    """
    if same is None:
        return solve_within(normal, right, low, high)
    first, second = same
    found = np.zeros(len(right))
    for zero in (second, first):
        kept = np.delete(np.arange(len(right)), zero)
        inner = normal[np.ix_(kept, kept)]
        found[kept] = solve_within(inner, right[kept], low[kept], high[kept])
        found[zero] = 0.0
        if found[first] > low[first]:
            break
    return found


def determined(normal: FloatArray) -> NDArray[np.bool_]:
    """Return which x of `solve_within` the data determine, shape (n,).

    The columns have the scale of all data, of which these may be a part. An x is not determined
    where its column, or the same of several columns together, is zero to rounding.
    """
    sizes, axes = linalg.eigh(normal)
    free = axes[:, sizes <= LEAST_SHARE * sizes.max(initial=0.0)]
    return np.asarray(np.sum(free**2, axis=1) < np.sqrt(LEAST_SHARE))
