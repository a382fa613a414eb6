"""When a parameter changed from campaign to campaign.

Values in the order of their dates go through two one-sided cumulative sums (E. S. Page, "Continuous
inspection schemes", Biometrika 41 (1954)), one for a rise and one for a fall. A usual value is the
mean of the first campaigns since the last change; the spread of one campaign is that of the
differences of successive ones, which a change does not raise (D. C. Montgomery, "Introduction to
Statistical Quality Control", 6.4).

A sum alarms on chance once in some hundred campaigns, and sooner on outliers. Of the alarms those
are kept at which the values before, back to the change before it, and after, up to the next one,
differ in their ranks (H. B. Mann, D. R. Whitney, Annals of Mathematical Statistics 18 (1947)).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import stats

from estimation.recording import FloatArray
from estimation.watch import begin_of

LEARNT = 10
"""Campaigns behind a usual value."""
SLACK, LIMIT, MOST = 0.75, 5.0, 4.0
"""Spreads that do not count, the sum that raises an alarm, and the most that one campaign adds. A
usual value of ten campaigns is itself off by a third of a spread, so the slack is larger."""
BY_CHANCE = 1e-4
"""Probability by chance of values before and after that differ as much."""
MEDIAN_DIFFERENCE = 0.954
"""Median of the absolute difference of two normal values, in their spread."""


@dataclass(frozen=True)
class Change:
    """A change of a parameter."""

    first: int  # place of the first value after it
    alarm: int  # place of the value at which the sum passed its limit
    before: float  # median of the values before it, back to the change before
    after: float  # median of the values from it on, up to the next change


def changes(values: Sequence[float]) -> list[Change]:
    """Return the changes of a parameter, in order; none of fewer than `LEARNT` + 2 values."""
    series = np.asarray(values, dtype=np.float64)
    if len(series) < LEARNT + 2:
        return []
    spread = float(np.median(np.abs(np.diff(series)))) / MEDIAN_DIFFERENCE
    if spread == 0.0:
        return []
    alarms: dict[int, int] = {}
    start = 0
    while (raised := _first(series, start, spread)) is not None:
        start, alarm = raised
        alarms[start] = alarm
    parts = _confirmed(series, list(alarms))
    medians = [float(np.median(series[part.start : part.stop])) for part in parts]
    return [
        Change(part.start, alarms[part.start], medians[k], medians[k + 1])
        for k, part in enumerate(parts[1:])
    ]


def _confirmed(series: FloatArray, first: list[int]) -> list[range]:
    """Return the stretches between changes; the least certain changes are given up in turn."""
    while True:
        bounds = [0, *first, len(series)]
        parts = [range(a, b) for a, b in pairwise(bounds)]
        chance = [
            float(stats.mannwhitneyu(series[a.start : a.stop], series[b.start : b.stop]).pvalue)
            for a, b in pairwise(parts)
        ]
        if not chance or max(chance) < BY_CHANCE:
            return parts
        del first[int(np.argmax(chance))]


def _first(series: FloatArray, start: int, spread: float) -> tuple[int, int] | None:
    """Return the first value after the first change from a place on, and that of the alarm."""
    usual = float(series[start : start + LEARNT].mean())
    sums = [0.0, 0.0]
    rising: list[list[tuple[int, float]]] = [[], []]
    for place in range(start + LEARNT, len(series)):
        moved = float(np.clip((series[place] - usual) / spread, -MOST, MOST))
        for side, worse in enumerate((moved, -moved)):
            sums[side] = max(0.0, sums[side] + worse - SLACK)
            rising[side] = [*rising[side], (place, worse)] if sums[side] > 0.0 else []
            if sums[side] > LIMIT:
                return begin_of(rising[side]), place
    return None
