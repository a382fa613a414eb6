"""What a fit of physical states takes of one run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from estimation.bank.beyond import coordinates
from estimation.bank.fitting import Normal
from estimation.bank.states import Bank, held_within
from estimation.recording import FloatArray


@dataclass(frozen=True, eq=False)
class RunEvidence:
    """Samples of one run to fit: every fourth valid closing one.

    Attributes:
        rows: Filtered channels, shape (n, channels).
        design: The bank's products, shape (n, size).
        truth: The target without lag, shape (n,).
        normal: The run's share in the normal equations.
        ranges: Lowest and highest value of each judged channel, shape (2, judged).
        places: Conditions of each sample, shape (n, d); see `estimation.bank.beyond`.
        conditions: What was held constant in the run; the interval grows beyond their levels.
    """

    rows: FloatArray
    design: FloatArray
    truth: FloatArray
    normal: Normal
    ranges: FloatArray
    places: FloatArray
    conditions: Mapping[str, float | str] = field(default_factory=dict)

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
