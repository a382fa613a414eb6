"""Weights by ridge regression in which every run has an offset of its own.

The motor's friction changes from run to run by more than the fit errs within one: on the reference
rig the mean error of a run scatters by 2 mN m. Plain least squares takes every sample as news; here
the run's offset is a random effect. With equal correlation rho between all errors of a run, the
generalised least squares of n samples leaves out a share s of each run's means: s = n rho / (1 +
(n - 1) rho). The share is a setting, as neighbouring samples are no independent news either.

Source: generalised least squares of the random-intercept model, N. M. Laird and J. H. Ware,
"Random-effects models for longitudinal data", Biometrics 38 (1982).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from estimation.recording import FloatArray


@dataclass(frozen=True, slots=True)
class Settings:
    """How weights are found.

    Attributes:
        ridge: Penalty on a squared weight in units of its column's variance, a sample.
        offset_share: Share of each run's means that the fit leaves out, 0 to below 1.
    """

    ridge: float = 1e-4
    offset_share: float = 0.5


CHOICES = tuple(Settings(ridge, share) for ridge in (3e-5, 3e-4) for share in (0.0, 0.5))
"""Settings that `chosen` chooses from."""


@dataclass(frozen=True, eq=False)
class Normal:
    """A run's share in the normal equations.

    Attributes:
        count: Samples n.
        gram: X'X, shape (p, p).
        cross: X'Y, shape (p, targets).
        mean: Mean row of X, shape (p,).
        target: Mean row of Y, shape (targets,).
    """

    count: int
    gram: FloatArray
    cross: FloatArray
    mean: FloatArray
    target: FloatArray

    @classmethod
    def of(cls, design: FloatArray, targets: FloatArray) -> "Normal":
        """Reduce a run's design, shape (n, p), and its targets, shape (n, targets)."""
        gram, cross = design.T @ design, design.T @ targets
        return cls(len(design), gram, cross, design.mean(axis=0), targets.mean(axis=0))

    def only(self, target: int) -> "Normal":
        """Return the share of one target."""
        one = slice(target, target + 1)
        return Normal(self.count, self.gram, self.cross[:, one], self.mean, self.target[one])


@dataclass(frozen=True, eq=False)
class Pool:
    """Sums over runs: all that a fit needs of them, so that fits without some runs are cheap.

    Attributes:
        count: Samples.
        total: Sum of the rows of X, shape (p,).
        gram: X'X, shape (p, p).
        cross: X'Y, shape (p, targets).
        between: The share of `gram` that is the runs' means', shape (p, p).
        between_cross: The share of `cross` that is the runs' means', shape (p, targets).
    """

    count: int
    total: FloatArray
    gram: FloatArray
    cross: FloatArray
    between: FloatArray
    between_cross: FloatArray

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
            (means.T * counts) @ means,
            (means.T * counts) @ targets,
        )

    def without(self, part: "Pool") -> "Pool":
        """Return the sums over the other runs."""
        return Pool(
            self.count - part.count,
            self.total - part.total,
            self.gram - part.gram,
            self.cross - part.cross,
            self.between - part.between,
            self.between_cross - part.between_cross,
        )

    @property
    def spread(self) -> FloatArray:
        """Standard deviation of each column over all samples, shape (p,).

        It is infinite where a column does not vary, and 1 for the first column, the constant.
        """
        mean = self.total / self.count
        variance = np.diag(self.gram) / self.count - mean**2
        found = np.sqrt(np.where(variance > 1e-12 * np.maximum(mean**2, 1.0), variance, np.inf))
        found[0] = 1.0
        return np.asarray(found)


def solve(pool: Pool, settings: Settings) -> FloatArray:
    """Return the weights, shape (p, targets); the first column of the design is the constant.

    A column that does not vary gets no weight.

    Args:
        pool: The runs to fit.
        settings: How.
    """
    share, scale = settings.offset_share, pool.spread
    penalty = np.full(len(scale), settings.ridge * pool.count)
    penalty[0] = 0.0
    gram = (pool.gram - share * pool.between) / np.outer(scale, scale) + np.diag(penalty)
    cross = (pool.cross - share * pool.between_cross) / scale[:, None]
    return np.asarray(linalg.solve(gram, cross, assume_a="pos") / scale[:, None])


def chosen(whole: Pool, folds: Sequence[Pool]) -> Settings:
    """Return the settings of the least error on runs left out of the fit in turn.

    Args:
        whole: The runs to fit, of one target; nothing else is looked at.
        folds: The same runs in parts.
    """

    def loss(settings: Settings) -> float:
        total = 0.0
        for part in folds:  # the squared error, but for the target's own square
            weights = solve(whole.without(part), settings)[:, 0]
            total += float(weights @ part.gram @ weights - 2 * weights @ part.cross[:, 0])
        return total

    return min(CHOICES, key=loss)


def pull(
    runs: Sequence[Normal], prior: FloatArray, scale: FloatArray, stiffness: FloatArray
) -> FloatArray:
    """Return weights that fit the runs and stay near the prior, shape (p,).

    Args:
        runs: The runs to fit, of one target.
        prior: Weights to stay near, shape (p,).
        scale: Spread of each column where the prior was found, shape (p,).
        stiffness: Penalty on a weight's change in units of `scale`, a sample, shape (p,).
    """
    gram = np.sum([run.gram for run in runs], axis=0)
    cross = np.sum([run.cross for run in runs], axis=0)[:, 0]
    penalty = stiffness * sum(run.count for run in runs)
    scaled = gram / np.outer(scale, scale) + np.diag(penalty)
    rest = (cross - gram @ prior) / scale
    return np.asarray(prior + np.linalg.solve(scaled, rest) / scale)
