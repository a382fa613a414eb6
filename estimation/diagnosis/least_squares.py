"""Least squares over columns of very different sizes."""

import numpy as np

from estimation.recording import FloatArray

ALIKE = 1e-8
"""Columns scaled to one size, whose span is narrower than this in a direction, have it not."""


def least_squares(columns: FloatArray, aim: FloatArray) -> FloatArray:
    """Return the weights of columns, shape (n, k), that are nearest to an aim, shape (n,)."""
    scale = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    weights: FloatArray = np.linalg.lstsq(columns / scale, aim, rcond=ALIKE)[0] / scale
    return weights


def orthonormal(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis of what columns span, shape (n, rank)."""
    scale = np.linalg.norm(columns, axis=0)
    wide = columns[:, scale > 0] / scale[scale > 0]
    left, size, _ = np.linalg.svd(wide, full_matrices=False)
    return np.asarray(left[:, size > ALIKE * size.max(initial=1e-300)])


def beyond(base: FloatArray, columns: FloatArray) -> FloatArray:
    """Return what columns have that others do not, shape (n, k)."""
    if not base.shape[1]:
        return columns
    return np.asarray(columns - base @ np.linalg.lstsq(base, columns, rcond=1e-10)[0])


def told_beyond(base: FloatArray, columns: FloatArray, aim: FloatArray) -> FloatArray:
    """Return what columns tell of an aim that others do not, shape (n,)."""
    own = beyond(base, columns)
    return np.asarray(own @ np.linalg.lstsq(own, aim, rcond=1e-10)[0])
