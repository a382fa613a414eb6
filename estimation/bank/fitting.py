"""Weights by ridge regression with a separate offset of every run.

The motor's friction changes from run to run by more than the fit errs within one: on the reference
rig the mean error of a run scatters by 2 mN m. Plain least squares takes every sample as news; here
the run's offset is a random effect. With equal correlation rho between all errors of a run, the
generalised least squares of n samples removes a share s of each run's means: s = n rho / (1 +
(n - 1) rho). The share is a setting, as neighbouring samples are not independent either. The means
of the runs are then fitted again, with few weights: there are fewer runs than weights.

Source: generalised least squares of the random-intercept model, N. M. Laird and J. H. Ware,
"Random-effects models for longitudinal data", Biometrics 38 (1982).
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from estimation.recording import FloatArray


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the fit of the weights."""

    ridge: float = 1e-4  # penalty on a squared weight in units of its column's variance, a sample
    offset_share: float = 0.5  # share of each run's means that the fit removes, 0 to below 1


CHOICES = tuple(Settings(ridge, share) for share in (0.8, 0.5, 0.0) for ridge in (1e-4, 1e-5))
"""Settings that `chosen` chooses from, those that trust the runs' means least first."""

HARDLY = 1e-4
"""Spread of a column, relative to its size, below which it gets no weight: its small variation
would be scaled to the size of the others, beyond the numerical precision."""

BETWEEN_RIDGE = 1e-2
"""Penalty of the weights that the runs' means are fitted with; runs are fewer than samples."""

AS_GOOD = 1.02
"""Squared errors that differ by less are alike, and the first choice is taken."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Properties of the columns that a fit needs."""

    stiffness: FloatArray  # how stiffly each weight is held, relative to the ridge penalty, (p,)
    between: NDArray[np.int64]  # columns that the runs' means are fitted with, the constant first

    @classmethod
    def plain(cls, size: int) -> "Shape":
        """Return the shape of columns that are all alike."""
        return cls(np.ones(size), np.arange(1))


@dataclass(frozen=True, eq=False)
class Normal:
    """A run's share in the normal equations."""

    count: int  # samples n
    gram: FloatArray  # X'X, shape (p, p)
    cross: FloatArray  # X'Y, shape (p, targets)
    square: FloatArray  # sum of squares of each target, shape (targets,)
    mean: FloatArray  # mean row of X, shape (p,)
    target: FloatArray  # mean row of Y, shape (targets,)

    @classmethod
    def of(cls, design: FloatArray, targets: FloatArray) -> "Normal":
        """Reduce a run's design, shape (n, p), and its targets, shape (n, targets)."""
        gram, cross, square = design.T @ design, design.T @ targets, (targets**2).sum(axis=0)
        return cls(len(design), gram, cross, square, design.mean(axis=0), targets.mean(axis=0))

    def only(self, target: int) -> "Normal":
        """Return the share of one target."""
        one = slice(target, target + 1)
        cross, square = self.cross[:, one], self.square[one]
        return replace(self, cross=cross, square=square, target=self.target[one])


@dataclass(frozen=True, eq=False)
class Pool:
    """Sums over runs: all that a fit needs of them, so that fits without some runs are cheap."""

    count: int  # samples
    total: FloatArray  # sum of the rows of X, shape (p,)
    gram: FloatArray  # X'X, shape (p, p)
    cross: FloatArray  # X'Y, shape (p, targets)
    square: FloatArray  # sum of squares of each target, shape (targets,)
    between: FloatArray  # the share of `gram` that is the runs' means', shape (p, p)
    between_cross: FloatArray  # the share of `cross` that is the runs' means', shape (p, targets)

    @classmethod
    def of(cls, runs: Sequence[Normal]) -> "Pool":
        """Sum over runs, none of them empty."""
        counts = np.array([run.count for run in runs], dtype=np.float64)
        means = np.array([run.mean for run in runs])
        targets = np.array([run.target for run in runs])
        return cls(
            sum(run.count for run in runs),
            counts @ means,
            np.sum([run.gram for run in runs], axis=0),
            np.sum([run.cross for run in runs], axis=0),
            np.sum([run.square for run in runs], axis=0),
            (means.T * counts) @ means,
            (means.T * counts) @ targets,
        )

    def without(self, part: "Pool") -> "Pool":
        """Return the sums over the other runs."""
        return Pool(*(getattr(self, f.name) - getattr(part, f.name) for f in fields(self)))

    @property
    def spread(self) -> FloatArray:
        """Standard deviation of each column over all samples, shape (p,).

        It is infinite for a nearly constant column, and 1 for the first column, the constant.
        """
        mean = self.total / self.count
        variance = np.diag(self.gram) / self.count - mean**2
        least = HARDLY**2 * np.maximum(mean**2, 1.0)
        found = np.sqrt(np.where(variance > least, variance, np.inf))
        found[0] = 1.0
        return np.asarray(found)


def solve(pool: Pool, shape: Shape, settings: Settings) -> FloatArray:
    """Return the weights, shape (p, targets); the first column of the design is the constant.

    A nearly constant column gets no weight.
    """
    share, scale = settings.offset_share, pool.spread
    penalty = settings.ridge * pool.count * shape.stiffness
    gram, cross = pool.gram - share * pool.between, pool.cross - share * pool.between_cross
    weights = _ridge(gram, cross, scale, penalty)
    few = shape.between
    rest = pool.cross - pool.gram @ weights
    held = BETWEEN_RIDGE * pool.count * shape.stiffness[few]
    weights[few] += _ridge(pool.gram[np.ix_(few, few)], rest[few], scale[few], held)
    return weights


def _ridge(
    gram: FloatArray, cross: FloatArray, scale: FloatArray, penalty: FloatArray
) -> FloatArray:
    """Return weights that are held at zero, but for the first one, shape (p, targets)."""
    held = np.diag(np.concatenate([[0.0], penalty[1:]]))
    scaled = gram / np.outer(scale, scale) + held
    solved = linalg.solve(scaled, cross / scale[:, None], assume_a="pos")
    return np.asarray(solved / scale[:, None])


def chosen(whole: Pool, folds: Sequence[Pool], shape: Shape) -> Settings:
    """Return the settings of the least error on runs of one target, left out in turn in folds.

    Among those that are as good as the best, it is the one that uses the runs' means least: runs
    left out at random contain little information about runs that are unlike all others.
    """

    def loss(settings: Settings) -> float:
        total = 0.0
        for part in folds:
            weights = solve(whole.without(part), shape, settings)[:, 0]
            total += float(weights @ part.gram @ weights - 2 * weights @ part.cross[:, 0])
            total += float(part.square[0])
        return total

    losses = [loss(settings) for settings in CHOICES]
    alike = [loss <= AS_GOOD * min(losses) for loss in losses]
    return CHOICES[alike.index(True)]


def pull(
    runs: Sequence[Normal],
    prior: FloatArray,
    scale: FloatArray,
    stiffness: FloatArray,
    more: tuple[FloatArray, FloatArray] | None = None,
) -> FloatArray:
    """Return weights that fit runs of one target and stay near the prior, shape (p,).

    `scale` is the spread of each column where the prior was found, `stiffness` the penalty on a
    weight's change in units of it, a sample. `more` are normal equations, (p, p) and (p,), that
    also count, a sample.
    """
    gram = np.sum([run.gram for run in runs], axis=0)
    cross = np.sum([run.cross for run in runs], axis=0)[:, 0]
    count = sum(run.count for run in runs)
    if more is not None:
        gram, cross = gram + count * more[0], cross + count * more[1]
    scaled = gram / np.outer(scale, scale) + np.diag(count * stiffness)
    rest = (cross - gram @ prior) / scale
    return np.asarray(prior + np.linalg.solve(scaled, rest) / scale)
