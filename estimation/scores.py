"""How good an estimate is: the error measures of the grip-torque papers, in the input's unit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from estimation.errors import EstimationError


class ScoreError(EstimationError):
    """An estimate and its truth cannot be compared."""


@dataclass(frozen=True, slots=True)
class Score:
    """Error of an estimate over n samples."""

    samples: int
    mae: float  # mean absolute error
    p95: float  # 95th percentile of the absolute error
    rmse: float  # root mean square error
    # Pearson's correlation of estimate and truth; NaN when one of them is constant
    pearson_r: float
    spearman_rho: float  # Spearman's rank correlation; NaN when one of them is constant


def rmse(estimate: ArrayLike, truth: ArrayLike) -> float:
    """Return the root mean square error of an array to another one or to a number."""
    return float(np.sqrt(np.mean(np.square(np.asarray(estimate) - np.asarray(truth)))))


def score(estimate: ArrayLike, truth: ArrayLike) -> Score:
    """Score an estimate, shape (n,), against the measured truth in the same unit.

    Raises:
        ScoreError: The shapes differ, the arrays are empty, or a value is not finite.
    """
    estimated = np.asarray(estimate, dtype=np.float64)
    measured = np.asarray(truth, dtype=np.float64)
    if estimated.shape != measured.shape or estimated.ndim != 1 or estimated.size == 0:
        raise ScoreError(
            f"An estimate of shape {estimated.shape} cannot be scored against {measured.shape}.",
            "Both must hold the same samples, at least one.",
        )
    if not (np.isfinite(estimated).all() and np.isfinite(measured).all()):
        raise ScoreError(
            "An estimate or its truth holds values that are not finite.",
            "A score over the remaining samples would hide them.",
            "Exclude these samples explicitly, and report it.",
        )
    error = np.abs(estimated - measured)
    varies = bool(np.ptp(estimated) > 0 and np.ptp(measured) > 0)
    return Score(
        samples=int(error.size),
        mae=float(error.mean()),
        p95=float(np.percentile(error, 95)),
        rmse=rmse(error, 0.0),
        pearson_r=float(np.corrcoef(estimated, measured)[0, 1]) if varies else float("nan"),
        spearman_rho=(
            float(stats.spearmanr(estimated, measured).statistic) if varies else float("nan")
        ),
    )
