"""When a parameter changed from campaign to campaign.

Values in the order of their dates go through two one-sided cumulative sums (E. S. Page, "Continuous
inspection schemes", Biometrika 41 (1954)), one for a rise and one for a fall. A usual value is the
mean of the first campaigns since the last change; the spread of one campaign is that of the
differences of successive ones, which a change does not raise (D. C. Montgomery, "Introduction to
Statistical Quality Control", 6.4).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimation.recording import FloatArray
from estimation.watch import begin_of

LEARNT = 10
"""Campaigns behind a usual value."""
SLACK, LIMIT, MOST = 0.75, 5.0, 4.0
"""Spreads that do not count, the sum that raises an alarm, and the most that one campaign adds. A
usual value of ten campaigns is itself off by a third of a spread, so the slack is larger."""
MEDIAN_DIFFERENCE = 0.954
"""Median of the absolute difference of two normal values, in their spread."""


@dataclass(frozen=True)
class Change:
    """A change of a parameter.

    Attributes:
        first: Place of the first value after it.
        alarm: Place of the value at which the sum passed its limit.
        before: Usual value before it.
        after: Mean of the values from `first` to `alarm`.
    """

    first: int
    alarm: int
    before: float
    after: float


def changes(values: Sequence[float]) -> list[Change]:
    """Return the changes of a parameter, in order; none of fewer than `LEARNT` + 2 values."""
    series = np.asarray(values, dtype=np.float64)
    found: list[Change] = []
    if len(series) < LEARNT + 2:
        return found
    spread = float(np.median(np.abs(np.diff(series)))) / MEDIAN_DIFFERENCE
    if spread == 0.0:
        return found
    start = 0
    while (change := _first(series, start, spread)) is not None:
        found.append(change)
        start = change.first
    return found


def _first(series: FloatArray, start: int, spread: float) -> Change | None:
    usual = float(series[start : start + LEARNT].mean())
    sums = [0.0, 0.0]
    rising: list[list[tuple[int, float]]] = [[], []]
    for place in range(start + LEARNT, len(series)):
        moved = float(np.clip((series[place] - usual) / spread, -MOST, MOST))
        for side, worse in enumerate((moved, -moved)):
            sums[side] = max(0.0, sums[side] + worse - SLACK)
            rising[side] = [*rising[side], (place, worse)] if sums[side] > 0.0 else []
            if sums[side] > LIMIT:
                first = begin_of(rising[side])
                return Change(first, place, usual, float(series[first : place + 1].mean()))
    return None
