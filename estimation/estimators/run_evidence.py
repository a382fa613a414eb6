"""What a fit of physical states takes of one run, and its interval from runs left out in turn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from estimation.bank.beyond import Visits, coordinates, within
from estimation.bank.edges import edges
from estimation.bank.fitting import Normal, Pool, Settings, solve
from estimation.bank.interval import Interval, calibrate, student, with_scores
from estimation.bank.states import Bank, held_within
from estimation.recording import FloatArray

INNER_FOLDS = 5
LEAST_SCORE = 0.02
"""Scores of left-out levels that differ by less from the usual one do not make a price higher."""


@dataclass(frozen=True, eq=False)
class RunEvidence:
    """Samples of one run to fit: every fourth valid closing one."""

    rows: FloatArray  # filtered channels, shape (n, channels)
    design: FloatArray  # the bank's products, shape (n, size)
    truth: FloatArray  # the target without lag, shape (n,)
    normal: Normal  # the run's share in the normal equations
    ranges: FloatArray  # lowest and highest value of each judged channel, shape (2, judged)
    places: FloatArray  # conditions of each sample, shape (n, d); see `estimation.bank.beyond`
    conditions: Mapping[str, float | str] = field(default_factory=dict)  # what was held constant

    @classmethod
    def of_rows(
        cls,
        bank: Bank,
        rows: FloatArray,
        truths: FloatArray,
        conditions: Mapping[str, float | str] | None = None,
    ) -> "list[RunEvidence]":
        """Return the evidence for each target; they share what is made of the rows.

        Rows are filtered channels of the samples to fit, shape (n, channels); the targets are
        `truths`, shape (n, targets).
        """
        design = bank.design(rows)
        judged = rows[:, : bank.judged]
        ranges = np.array([judged.min(axis=0), judged.max(axis=0)])
        whole, places = Normal.of(design, truths), coordinates(bank, rows)
        return [
            cls(rows, design, truth, whole.only(k), ranges, places, conditions or {})
            for k, truth in enumerate(np.ascontiguousarray(truths.T))
        ]

    def estimate(self, bank: Bank, weights: FloatArray, ranges: FloatArray) -> FloatArray:
        """Return the estimates by weights that were fitted in these ranges, shape (n,)."""
        return np.asarray(within_ranges(bank, self.design, self.rows, ranges) @ weights)


def ranges_of(ranges: Sequence[FloatArray]) -> FloatArray:
    """Return the lowest and highest value of each judged channel, shape (2, judged)."""
    lowest, highest = zip(*ranges, strict=True)
    return np.array([np.min(lowest, axis=0), np.max(highest, axis=0)])


def within_ranges(
    bank: Bank, design: FloatArray, rows: FloatArray, ranges: FloatArray
) -> FloatArray:
    """Return a design, shape (n, size), as at the nearest angle and pose fitted.

    It is made of rows of filtered channels, (n, channels); `ranges` are the lowest and highest
    value of each judged channel fitted on, shape (2, judged).
    """
    held = held_within(bank, rows, ranges)
    moved = np.flatnonzero((held != rows).any(axis=1) & np.isfinite(rows).all(axis=1))
    if moved.size:
        design = design.copy()
        design[moved] = bank.design(held[moved])
    return design


def interval_of(
    runs: Sequence[RunEvidence], whole: Pool, bank: Bank, settings: Settings
) -> Interval:
    """Return the interval of a fit of at least `INNER_FOLDS` runs, reduced with the bank.

    `whole` are their sums, the settings how the weights are found.
    """

    def errors(left_out: NDArray[np.int_]) -> list[FloatArray]:
        rest = whole.without(Pool.of([runs[k].normal for k in left_out]))
        weights = solve(rest, bank.shape, settings)[:, 0]
        fitted = ranges_of([run.ranges for k, run in enumerate(runs) if k not in left_out])
        return [runs[k].estimate(bank, weights, fitted) - runs[k].truth for k in left_out]

    order = np.arange(len(runs))
    folds = [order[k::INNER_FOLDS] for k in range(INNER_FOLDS)]
    held_out = {k: e for f in folds for k, e in zip(f, errors(f), strict=True)}
    designs, visits = [run.design for run in runs], Visits([run.places for run in runs])
    table = visits.scores(order)
    interval = calibrate(bank, designs, [held_out[k] for k in order], table)
    usual_score = float(np.mean([visits.mean_score(fold) for fold in folds]))
    scale = student(len(runs) - 1)
    excess, score = [], []
    for level in edges([run.conditions for run in runs], INNER_FOLDS) or _quarters(runs):
        rest = [run.places for k, run in enumerate(runs) if k not in level]
        more = [
            error[known] ** 2 - (interval.usual(designs[k][known]) / scale) ** 2
            for k, error in zip(level, errors(level), strict=True)
            if (known := within(runs[k].places, rest)).any()
        ]
        if more:
            excess.append(float(np.mean([part.mean() for part in more])))
            score.append(visits.mean_score(level) - usual_score)
    price = max(float(np.mean(excess)), 0.0) / max(float(np.mean(score)), LEAST_SCORE)
    priced = replace(interval, price=scale**2 * price, usual_score=usual_score)
    # few levels can be left out, so the price is less certain than the usual width
    return with_scores(priced, table.values, (student(len(excess)) / scale) ** 2)


def _quarters(runs: Sequence[RunEvidence]) -> list[NDArray[np.int_]]:
    """Return the quarter of the runs with the lowest and the highest mean of each condition."""
    means = np.array([run.places.mean(axis=0) for run in runs])
    order, count = np.argsort(means, axis=0), max(1, len(runs) // 4)
    return [part for axis in order.T for part in (axis[:count], axis[-count:])]
