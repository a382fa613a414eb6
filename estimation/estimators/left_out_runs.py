"""The interval of a fit of physical states, from its runs left out in turn."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation.bank.beyond import Visits, within
from estimation.bank.edges import edges
from estimation.bank.fitting import Pool, Settings, solve
from estimation.bank.interval import Interval, calibrate, student, with_scores
from estimation.bank.states import Bank
from estimation.estimators.run_evidence import RunEvidence, ranges_of
from estimation.recording import FloatArray

INNER_FOLDS = 5
LEAST_SCORE = 0.02
"""Scores of left-out levels that differ by less from the usual one do not make a price higher."""


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
