"""Least squares with the run as the unit of evidence."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from calibration.quality import BadDataError, check_limit, check_points
from calibration.record import Fit
from estimation.recording import FloatArray

Run = tuple[FloatArray, FloatArray]
"""One run's columns, shape (n, p), and its target, shape (n,)."""


@dataclass(frozen=True, eq=False)
class Regression:
    """A fit over runs.

    Attributes:
        values: Coefficients, shape (p,).
        covariance: Of the coefficients, from the runs' scores (the sandwich of Liang and Zeger
            1986), shape (p, p).
        residual_rms: Over all samples.
        residuals: Each run's, target less fit.
        held_out: Each run's mean square error by the fit on all others, shape (runs,).
    """

    values: FloatArray
    covariance: FloatArray
    residual_rms: float
    residuals: tuple[FloatArray, ...]
    held_out: FloatArray

    def half_widths(self, level: float = 0.95) -> FloatArray:
        """Return the half-widths of the coefficients' intervals, Student's over the runs."""
        freedom = max(1, len(self.residuals) - 1)
        return np.asarray(stats.t.ppf((1 + level) / 2, freedom) * np.sqrt(np.diag(self.covariance)))

    @property
    def size(self) -> int:
        """Number of samples."""
        return sum(residual.size for residual in self.residuals)

    def as_fit(self, form: str, *names: str) -> Fit:
        """Return it as a calibration record keeps it, its coefficients by name."""
        parameters = dict(zip(names, self.values.tolist(), strict=True))
        return Fit(form, parameters, self.covariance, self.residual_rms, self.size)


def regress(runs: Sequence[Run], least_runs: int = 3) -> Regression:
    """Fit the target on the columns of all runs.

    Raises:
        BadDataError: Too few runs or samples, or collinear columns.
    """
    check_points(len(runs), least_runs, "runs")
    design = np.concatenate([columns for columns, _ in runs])
    target = np.concatenate([values for _, values in runs])
    check_points(len(target), 20 * design.shape[1], "samples")
    scaled = design / np.maximum(np.abs(design).max(axis=0), 1e-300)
    if np.linalg.matrix_rank(scaled, tol=1e-9 * len(target)) < design.shape[1]:
        raise BadDataError(
            "no_change",
            "Two of the unknown quantities change only together.",
            "They cannot be separated by one experiment.",
            "Use more levels of load, both directions and more than one speed.",
        )
    values = np.linalg.lstsq(design, target)[0]
    bread = np.linalg.inv(design.T @ design)
    residuals = tuple(y - x @ values for x, y in runs)
    scores = np.array([x.T @ e for (x, _), e in zip(runs, residuals, strict=True)])
    covariance = bread @ (scores.T @ scores) @ bread * len(runs) / (len(runs) - 1)
    left = np.concatenate(residuals)
    return Regression(
        values,
        np.asarray(covariance),
        float(np.sqrt(np.mean(left**2))),
        residuals,
        np.array([_held_out(runs, k) for k in range(len(runs))]),
    )


def refuse_drift(
    fit: Regression,
    span: float,
    limit: float = 0.05,
    fix: str = "Let the rig and its amplifiers warm up, then begin again.",
) -> float:
    """Return how far the last run's residual is from the first's, over the span of the target.

    Raises:
        BadDataError: It is beyond the limit.
    """
    drift = float(fit.residuals[-1].mean() - fit.residuals[0].mean()) / span
    check_limit("drift", abs(drift), limit, "Drift from the first to the last run", fix)
    return drift


def is_better(more: FloatArray, fewer: FloatArray) -> bool:
    """Return whether the larger of two fits predicts runs left out better, by a standard error.

    Both are mean square errors on runs left out, shape (runs,).
    """
    gain = fewer - more
    return bool(gain.mean() > gain.std(ddof=1) / np.sqrt(gain.size))


def _held_out(runs: Sequence[Run], left_out: int) -> float:
    others = [run for k, run in enumerate(runs) if k != left_out]
    design = np.concatenate([columns for columns, _ in others])
    values = np.linalg.lstsq(design, np.concatenate([y for _, y in others]))[0]
    columns, target = runs[left_out]
    return float(np.mean((target - columns @ values) ** 2))
