"""How far a sample lies from the conditions that runs were fitted in, and what that adds.

The conditions of a sample are where the drive is, how it is loaded, how fast it turns (in octaves)
and the wrist's pose. On a grid of them each run counts where it dwelt. The score of a place is the
variance left of a Gaussian process with unit variance after one observation of each run there: near
0 where many runs were, 1 a few kernel lengths away from all.

What a score costs is measured, not assumed: levels at the edge of a condition are left out in turn,
and their errors beyond the usual ones, over their scores beyond the usual one, are the variance per
score. Few levels can be left out, so its quantile is Student's. It is added to the square of half
the interval's width; beyond the grid, opening or at rest, the width is not known. The grid ends
where runs had no angle or pose: a polynomial carried there has errors that no score foretells.

Source: C. E. Rasmussen, C. K. I. Williams, "Gaussian Processes for Machine Learning" (2006),
equation 2.26, with places visited by n runs observed with noise variance 1 / n.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from estimation.bank.states import GEAR_RATIO, JUDGED, Bank
from estimation.recording import FloatArray

STEPS = (0.5, 0.25, 0.5, 0.25)
"""Step of the grid and length of the kernel: of angle, load and pose a share of the range fitted,
of speed in octaves."""
OCTAVES = 2
"""The coordinate in octaves."""
HELD, MARGIN = (0, 3), 0.1
"""Angle and pose, and the share of their range that the grid reaches beyond it."""
TAIL = 0.005
"""Share of the samples at each end that the grid need not hold: starts and stops."""
VISITED = 0.02
"""Runs that make a node visited; a run counts as 1 where it dwelt for its mean time a node."""
STANDING_RAD_S = 1e-6
LEAST_SPAN = 1e-6
"""Of a condition that all runs share, so that the grid has a step."""


def coordinates(bank: Bank, rows: FloatArray) -> FloatArray:
    """Return the conditions of rows of filtered channels, shape (n, 3), or (n, 4) with a pose."""
    speed = np.log2(np.maximum(rows[:, 2] / GEAR_RATIO, STANDING_RAD_S))
    columns = [rows[:, 0], rows[:, 1], speed]
    return np.column_stack(columns + ([rows[:, JUDGED]] if bank.pose else []))


@dataclass(frozen=True, eq=False)
class Beyond:
    """A table over the conditions."""

    lowest: FloatArray  # conditions of the first node, shape (d,)
    step: FloatArray  # distance of the nodes, shape (d,)
    values: FloatArray  # what is looked up, at each node, d axes

    def at(self, places: FloatArray) -> FloatArray:
        """Return the values at conditions, (n, d), between nodes: shape (n,), NaN beyond them."""
        at = (places - self.lowest) / self.step
        at = np.where(np.isfinite(at), at, -1.0)
        found = ndimage.map_coordinates(self.values, at.T, order=1, cval=np.nan, prefilter=False)
        return np.asarray(found)


def cut_to(table: Beyond, places: FloatArray) -> Beyond | None:
    """Return a table of the angles and poses that places have too; None where it has none of them.

    Places are conditions, shape (n, d).
    """
    lowest, step, nodes = table.lowest.copy(), table.step.copy(), np.array(table.values.shape)
    for axis in (axis for axis in HELD if axis < len(lowest)):
        low, high = np.quantile(places[:, axis], [TAIL, 1.0 - TAIL])
        margin = MARGIN * max(high - low, LEAST_SPAN)
        first = max(low - margin, lowest[axis])
        last = min(high + margin, lowest[axis] + step[axis] * (nodes[axis] - 1))
        if first >= last:
            return None
        lowest[axis], step[axis] = first, (last - first) / (nodes[axis] - 1)
    grid = np.indices(table.values.shape).reshape(len(lowest), -1).T * step + lowest
    end = table.lowest + table.step * (nodes - 1)
    values = table.at(np.clip(grid, table.lowest, end))
    return Beyond(lowest, step, values.reshape(table.values.shape))


class Visits:
    """Where runs were: the scores of any of them by the others."""

    def __init__(self, runs: Sequence[FloatArray], like: Beyond | None = None) -> None:
        """Count the runs at each node, of a grid that holds them or of that of a table.

        Each run is the conditions of its samples, shape (n, d).
        """
        if like is None:
            self.lowest, self.step, nodes = _grid(np.concatenate(runs))
        else:
            self.lowest, self.step, nodes = like.lowest, like.step, np.array(like.values.shape)
        self.nodes: NDArray[np.int64] = nodes
        self._places = list(runs)
        self._counts = np.array([self._visits(run) for run in runs])
        grid = np.indices(tuple(nodes)).reshape(len(nodes), -1).T
        square = (grid**2).sum(axis=1)
        self._kernel = np.exp(grid @ grid.T - 0.5 * (square[:, None] + square))

    def _visits(self, run: FloatArray) -> FloatArray:
        nearest = np.rint((run - self.lowest) / self.step).astype(np.int64)
        held = np.clip(nearest, 0, self.nodes - 1)
        flat = np.ravel_multi_index(tuple(held.T), tuple(self.nodes))
        count = np.bincount(flat, minlength=int(np.prod(self.nodes))).astype(np.float64)
        return np.asarray(count / count[count > 0].mean())

    def scores(self, runs: NDArray[np.int_]) -> Beyond:
        """Return the score of each place by these runs."""
        count = self._counts[runs].sum(axis=0)
        at = np.flatnonzero(count > VISITED)
        observed = self._kernel[np.ix_(at, at)] + np.diag(1.0 / count[at])
        factor = np.linalg.solve(np.linalg.cholesky(observed), self._kernel[at])
        left = np.clip(1.0 - (factor**2).sum(axis=0), 0.0, 1.0)
        return Beyond(self.lowest, self.step, left.reshape(tuple(self.nodes)))

    def mean_score(self, left_out: NDArray[np.int_]) -> float:
        """Return the mean over some runs of their score by all the others."""
        return self._mean(np.setdiff1d(np.arange(len(self._counts)), left_out), left_out)

    def mean_by(self, runs: NDArray[np.int_]) -> float:
        """Return the mean over all runs of their score by some of them."""
        return self._mean(runs, np.arange(len(self._counts)))

    def _mean(self, runs: NDArray[np.int_], of: NDArray[np.int_]) -> float:
        table = self.scores(runs)
        return float(np.mean([np.nanmean(table.at(self._places[k])) for k in of]))


def within(places: FloatArray, runs: Sequence[FloatArray]) -> NDArray[np.bool_]:
    """Return whether places lie on the grid of some runs, shape (n,)."""
    lowest, step, nodes = _grid(np.concatenate(runs))
    at = (places - lowest) / step
    return np.asarray(((at >= 0.0) & (at <= nodes - 1)).all(axis=1))


def _grid(places: FloatArray) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Return the first node, the step and the number of nodes, each of shape (d,)."""
    low, high = np.quantile(places, [TAIL, 1.0 - TAIL], axis=0)
    share = np.array(STEPS[: places.shape[1]])
    span = np.maximum(high - low, LEAST_SPAN)
    step = np.where(np.arange(len(share)) == OCTAVES, share, share * span)
    held = np.isin(np.arange(len(share)), HELD)
    step = np.where(held, (1.0 + 2.0 * MARGIN) * step, step)
    nodes = np.where(held, np.round(1.0 / share), np.ceil(span / step) + 2).astype(np.int64) + 1
    return (low + high - step * (nodes - 1)) / 2, step, nodes
