"""Intervals from the errors on runs that were not fitted.

The width follows the state: a linear fit of the absolute error on a few products, scaled by the
root mean square of left-out errors over it. A run's own offset is the larger part of the error,
so the runs are the sample, not their readings: of R runs the quantile is Student's with R - 1
degrees of freedom, and the variance of a new run's prediction 1 + 1 / R times theirs. The conformal
quantile of so few runs would be their largest error, twice as wide as needed on 20 runs (decision
221).

Away from the fitted conditions the squared half width grows (`estimation.bank.beyond`).

Sources: the shape as in J. Lei et al., "Distribution-free predictive inference for regression",
Journal of the American Statistical Association 113 (2018), section 5.2; the quantile as of a new
observation of a normal sample, G. J. Hahn, W. Q. Meeker, "Statistical Intervals" (1991), 4.7.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from estimation.bank.beyond import Beyond
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
    """What the error looks like."""

    columns: np.ndarray  # columns of the design that the width depends on, shape (m,)
    weights: FloatArray  # their weights, shape (m,), in the target's unit
    least: float  # smallest half width, in the target's unit
    beyond: Beyond  # added to its square away from the fitted conditions; NaN beyond its nodes
    price: float = 0.0  # what a score of 1 adds to its square, the target's unit squared
    usual_score: float = 0.0  # score that left-out runs have, which the weights include

    @property
    def typical(self) -> float:
        """Half the width where the error is of its mean size, in the target's unit."""
        return self.least / NARROWEST

    def half_width(self, design: FloatArray, places: FloatArray) -> FloatArray:
        """Return half the interval's width for each row of a design, shape (n,); NaN if unknown.

        Its places are their conditions, from `estimation.bank.beyond.coordinates`.
        """
        return np.asarray(np.sqrt(self.usual(design) ** 2 + self.beyond.at(places)))

    def usual(self, design: FloatArray) -> FloatArray:
        """Return the half width where runs were fitted, shape (n,)."""
        width = np.maximum(design[:, self.columns] @ self.weights, self.least)
        return np.where(np.isfinite(design).all(axis=1), width, np.nan)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the interval as named arrays."""
        return {
            "width_columns": self.columns,
            "width_weights": self.weights,
            "width_least": np.array(self.least),
            "beyond_lowest": self.beyond.lowest,
            "beyond_step": self.beyond.step,
            "beyond_values": self.beyond.values,
            "beyond_price": np.array([self.price, self.usual_score]),
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
            Beyond(arrays["beyond_lowest"], arrays["beyond_step"], arrays["beyond_values"]),
            *arrays["beyond_price"].tolist(),
        )


def calibrate(
    bank: Bank, designs: Sequence[FloatArray], residuals: Sequence[FloatArray], grid: Beyond
) -> Interval:
    """Return the interval of the errors on left-out runs, with nothing added anywhere.

    Each run has a design of the bank, shape (n, size), and residuals by weights that it was not
    fitted with, shape (n,). The nodes of the grid are those of the conditions.
    """
    columns = np.array([bank.products.index(p) for p in SHAPE if p in bank.products])
    sizes = [np.abs(residual) for residual in residuals]
    parts = [design[:, columns] for design in designs]
    runs = [Normal.of(part, size[:, None]) for part, size in zip(parts, sizes, strict=True)]
    weights = solve(Pool.of(runs), Shape.plain(len(columns)), Settings(offset_share=0.0))[:, 0]
    nothing = replace(grid, values=np.zeros_like(grid.values))
    shape = Interval(columns, weights, NARROWEST * float(np.concatenate(sizes).mean()), nothing)
    usual = [shape.usual(design) for design in designs]
    pairs = zip(sizes, usual, strict=True)
    squares = [float(np.mean((size / width) ** 2)) for size, width in pairs]
    return scaled(shape, of_new_run(squares))


def of_new_run(squares: Sequence[float]) -> float:
    """Return half the interval of a new run, of the mean squared errors of runs not fitted on."""
    variance = (1 + 1 / len(squares)) * float(np.mean(squares))
    return student(len(squares) - 1) * float(np.sqrt(variance))


def with_scores(interval: Interval, scores: FloatArray, doubt: float = 1.0) -> Interval:
    """Return an interval whose squared half width also grows by a score of each node of its grid.

    `doubt` is a factor on its price.
    """
    added = doubt * interval.price * np.maximum(scores - interval.usual_score, 0.0)
    beyond = replace(interval.beyond, values=interval.beyond.values + added)
    return replace(interval, beyond=beyond)


def scaled(interval: Interval, factor: float) -> Interval:
    """Return an interval of another width everywhere."""
    return replace(
        interval,
        weights=factor * interval.weights,
        least=factor * interval.least,
        beyond=replace(interval.beyond, values=factor**2 * interval.beyond.values),
    )


def covered_share(error: FloatArray, half_width: FloatArray) -> float | None:
    """Return the share of errors inside their interval, of those that have one; None without."""
    stated = np.isfinite(half_width)
    return float(np.mean(np.abs(error) <= half_width, where=stated)) if stated.any() else None


def student(freedom: int) -> float:
    """Return the quantile of Student's distribution that `COVERAGE` lies within, both signs."""
    return float(stats.t.ppf((1 + COVERAGE) / 2, freedom))
