"""Damped least squares whose dissipative parameters cannot be negative, from cross-products.

The cross-products of all columns are made once; any subset of effects is then one small solution.
Negative friction gives energy away: a fit that needs it has found the wrong effect.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import nnls

from estimation.recording import FloatArray


@dataclass(frozen=True)
class Block:
    """Columns that belong together: the base, or one effect."""

    name: str
    at: NDArray[np.intp]  # their places among all columns
    dissipative: NDArray[np.bool_]  # of each, whether it cannot be negative
    damping: float  # over the squared length of each of its columns, or of the longest of them
    own_length: bool = False  # of each; else rarely visited columns stay small


@dataclass(frozen=True)
class Products:
    """Cross-products of weighted columns with one another and with the torque, by row."""

    gram: FloatArray  # shape (rows, columns, columns)
    right: FloatArray  # shape (rows, columns)
    square: FloatArray  # sum of squares of the torque, shape (rows,)
    samples: int  # number of samples

    @classmethod
    def of(cls, columns: FloatArray, torque: FloatArray) -> "Products":
        """Return the cross-products of columns (n, rows, k) with themselves and a torque."""
        by_row = columns.transpose(1, 0, 2)
        gram = np.stack([own.T @ own for own in by_row])
        right = np.stack([own.T @ torque[:, k] for k, own in enumerate(by_row)])
        return cls(gram, right, np.sum(torque**2, axis=0), len(torque))

    def rms(self, at: NDArray[np.intp], values: FloatArray) -> FloatArray:
        """Return the RMS residual of each row with some columns and these parameters."""
        gram = self.gram[:, at[:, None], at]
        squares = self.square - 2 * self.right[:, at] @ values + (gram @ values) @ values
        return np.sqrt(np.maximum(squares, 0.0) / self.samples)


@dataclass(frozen=True)
class Normal:
    """Cross-products summed over the rows, each with its weight squared.

    Of shape (columns, columns) and, with the torque on the right, (columns,).
    """

    gram: FloatArray
    right: FloatArray

    @classmethod
    def of(cls, products: Products, weights: FloatArray) -> "Normal":
        """Weigh cross-products by the weight of each row; shape (rows,)."""
        weight = weights**2
        return cls(np.tensordot(weight, products.gram, axes=1), weight @ products.right)


def solve(normal: Normal, blocks: Sequence[Block]) -> FloatArray:
    """Return the parameters of some blocks, in their order, that fit a path."""
    at = np.concatenate([block.at for block in blocks])
    gram, right = normal.gram[at[:, None], at], normal.right[at]
    length = _lengths(np.sqrt(np.diag(gram)), blocks)
    damping = np.concatenate([np.full(len(block.at), block.damping) for block in blocks])
    scaled = gram / np.outer(length, length) + np.diag(damping)
    root = cholesky(scaled)
    target = solve_triangular(root, right / length, trans="T")
    bounded = np.concatenate([block.dissipative for block in blocks])
    return _bounded(root, target, bounded) / length


def _lengths(own: FloatArray, blocks: Sequence[Block]) -> FloatArray:
    lengths, start = own.copy(), 0
    for block in blocks:
        part = lengths[start : start + len(block.at)]
        if not block.own_length and len(part):
            part[:] = part.max()
        start += len(block.at)
    lengths[lengths < 1e-12] = 1.0
    return lengths


def _bounded(table: FloatArray, target: FloatArray, bounded: NDArray[np.bool_]) -> FloatArray:
    """Solve least squares where some unknowns are not negative; the free ones are eliminated."""
    free, triangle = np.linalg.qr(table[:, ~bounded])
    values = np.zeros(table.shape[1])
    if bounded.any():
        rest = table[:, bounded] - free @ (free.T @ table[:, bounded])
        left = target - free @ (free.T @ target)
        values[bounded] = nnls(rest, left, maxiter=100 * rest.shape[1])[0]
    known = free.T @ (target - table[:, bounded] @ values[bounded])
    values[~bounded] = np.linalg.solve(triangle, known)
    return values
