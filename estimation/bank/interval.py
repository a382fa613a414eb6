"""Intervals from the errors on runs that were not fitted.

The width follows the state: a linear fit of the absolute error on a few products. It is then scaled
so that the wanted share of the errors on left-out runs lies inside. Since the run's offset is the
larger part of the error, a run lies wholly inside, or has a tail outside; the share holds over runs
like those fitted, not within each. Runs are the units that can be exchanged, so of R runs the
quantile is taken at coverage x (1 + 1 / R), as conformal prediction does for R samples. Where runs
state conditions, the width is raised so that the share holds too on the lowest and highest level of
each condition, left out in turn (`edges`, `widened`).

Source: locally weighted split conformal prediction, J. Lei et al., "Distribution-free predictive
inference for regression", Journal of the American Statistical Association 113 (2018), section 5.2.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimation.bank.fitting import Normal, Pool, Settings, Shape, solve
from estimation.bank.states import Bank, Product
from estimation.recording import FloatArray

COVERAGE = 0.95
NARROWEST = 0.5
"""Smallest width, a share of the mean absolute error."""

SHAPE: tuple[Product, ...] = (
    (), ("q",), ("c",), ("q", "q"), ("c", "c"), ("q", "c"), ("v",), ("i",), ("a",), ("d",),
    ("k2",), ("k4",),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Interval:
    """What the error looks like.

    Attributes:
        columns: Columns of the design that the width depends on, shape (m,).
        weights: Their weights, shape (m,), in the target's unit.
        least: Smallest half width, in the target's unit.
    """

    columns: np.ndarray
    weights: FloatArray
    least: float

    @property
    def typical(self) -> float:
        """Half the width where the error is of its mean size, in the target's unit."""
        return self.least / NARROWEST

    def half_width(self, design: FloatArray) -> FloatArray:
        """Return half the interval's width for each row of a design, shape (n,)."""
        width = np.maximum(design[:, self.columns] @ self.weights, self.least)
        return np.where(np.isfinite(design).all(axis=1), width, np.nan)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the interval as named arrays."""
        return {
            "width_columns": self.columns,
            "width_weights": self.weights,
            "width_least": np.array(self.least),
        }

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> "Interval | None":
        """Return the interval of named arrays, None where there is none."""
        if "width_columns" not in arrays:
            return None
        return cls(
            arrays["width_columns"].astype(np.int64),
            arrays["width_weights"],
            float(arrays["width_least"]),
        )


def rescaled(
    source: Interval,
    designs: Sequence[FloatArray],
    residuals: Sequence[FloatArray],
    coverage: float = COVERAGE,
) -> Interval:
    """Return an interval of the same shape that covers a few runs' errors; never a narrower one.

    Args:
        source: The interval before.
        designs: Design of each run, shape (n, size).
        residuals: Error of each run, shape (n,).
        coverage: The share, raised for few runs as in `calibrate`: up to 19 runs, all of them.
    """
    widths = np.concatenate([source.half_width(design) for design in designs])
    level = min(coverage * (1 + 1 / len(designs)), 1.0)
    factor = max(float(np.quantile(np.abs(np.concatenate(residuals)) / widths, level)), 1.0)
    return Interval(source.columns, factor * source.weights, factor * source.least)


def widened(
    interval: Interval,
    designs: Sequence[FloatArray],
    residuals: Sequence[FloatArray],
    coverage: float = COVERAGE,
) -> Interval:
    """Return an interval that covers a share of the errors beyond the edges; never a narrower one.

    Args:
        interval: The interval of runs like those fitted.
        designs: Design of each run at an extreme level of a condition, shape (n, size).
        residuals: Its error by weights fitted without that level, shape (n,).
        coverage: The share.
    """
    ratio = [
        np.abs(residual) / interval.half_width(design)
        for design, residual in zip(designs, residuals, strict=True)
    ]
    factor = max(float(np.quantile(np.concatenate(ratio), coverage)), 1.0)
    return Interval(interval.columns, factor * interval.weights, factor * interval.least)


def calibrate(
    bank: Bank,
    designs: Sequence[FloatArray],
    residuals: Sequence[FloatArray],
    coverage: float = COVERAGE,
) -> Interval:
    """Return the interval that covers a share of the errors on left-out runs.

    Args:
        bank: The bank of the designs.
        designs: Design of each run, shape (n, size).
        residuals: Error of each run by weights that it was not fitted with, shape (n,).
        coverage: The share.
    """
    columns = np.array([bank.products.index(p) for p in SHAPE if p in bank.products])
    sizes = [np.abs(residual) for residual in residuals]
    parts = [design[:, columns] for design in designs]
    runs = [Normal.of(part, size[:, None]) for part, size in zip(parts, sizes, strict=True)]
    weights = solve(Pool.of(runs), Shape.plain(len(columns)), Settings(offset_share=0.0))[:, 0]
    size = np.concatenate(sizes)
    least = NARROWEST * float(size.mean())
    width = np.maximum(np.concatenate(parts) @ weights, least)
    level = min(coverage * (1 + 1 / len(sizes)), 1.0)
    scale = float(np.quantile(size / width, level))
    return Interval(columns, scale * weights, scale * least)
