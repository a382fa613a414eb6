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


def spread(runs: Sequence[Normal]) -> FloatArray:
    """Return the standard deviation of each column over all samples, shape (p,).

    It is infinite where a column does not vary, and 1 for the first column, the constant.
    """
    count = sum(run.count for run in runs)
    mean = np.sum([run.count * run.mean for run in runs], axis=0) / count
    variance = np.diag(np.sum([run.gram for run in runs], axis=0)) / count - mean**2
    found = np.sqrt(np.where(variance > 1e-12 * np.maximum(mean**2, 1.0), variance, np.inf))
    found[0] = 1.0
    return np.asarray(found)


def solve(runs: Sequence[Normal], settings: Settings) -> FloatArray:
    """Return the weights, shape (p, targets); the first column of the design is the constant.

    A column that does not vary gets no weight.

    Args:
        runs: The runs to fit, none of them empty.
        settings: How.
    """
    share = settings.offset_share
    gram = np.sum([r.gram - share * r.count * np.outer(r.mean, r.mean) for r in runs], axis=0)
    cross = np.sum([r.cross - share * r.count * np.outer(r.mean, r.target) for r in runs], axis=0)
    scale = spread(runs)
    penalty = np.full(len(scale), settings.ridge * sum(run.count for run in runs))
    penalty[0] = 0.0
    scaled = gram / np.outer(scale, scale) + np.diag(penalty)
    return np.asarray(np.linalg.solve(scaled, cross / scale[:, None]) / scale[:, None])


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
