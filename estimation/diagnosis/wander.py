"""Whether what time alone moves is a fault, or the wander of a sensor's zero.

A zero that walks at random goes another way in each run, and over many runs its mean is seldom
nought: a test of the mean alone finds a drift in it. A fault of that kind comes again in run after
run, at about the same size.
"""

from collections.abc import Sequence

import numpy as np

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.least_squares import told_beyond
from estimation.recording import FloatArray

CLOCKS = {"time_s", "campaign_time_s"}
"""Channels that tell the time and nothing else."""


def steadiness(
    balance: Balance, terms: Sequence[Candidate], added: Sequence[Candidate]
) -> float | None:
    """Return the mean size over the runs of what time alone moves, over its spread from run to run.

    The least one where several of the effects are of time alone; None where none is, or where one
    run has no spread.

    Args:
        balance: The balance.
        terms: Declared effects and those found before.
        added: The effect, or the two of a pair.
    """
    found = [
        _steadiness(balance, [*terms, *(o for o in added if o is not one)], one)
        for one in added
        if {name for _, name in one.channels} <= CLOCKS
    ]
    return min(found) if found and len(balance.runs) > 1 else None


def _steadiness(balance: Balance, terms: Sequence[Candidate], one: Candidate) -> float:
    left = balance.left(terms)
    base, own = np.vstack(balance.base(terms)), np.vstack(balance.columns([one]))
    sizes = _sizes(told_beyond(base, own, np.concatenate(left)), left)
    spread = float(np.std(sizes, ddof=1))
    return float(np.mean(sizes)) / max(spread, np.finfo(float).tiny)


def _sizes(course: FloatArray, left: Sequence[FloatArray]) -> FloatArray:
    """Return how large a course is in each run, 1 where it is as in all together."""
    parts = np.split(course, np.cumsum([len(part) for part in left])[:-1])
    tiny = np.finfo(float).tiny
    return np.array(
        [float(p @ part) / max(float(p @ p), tiny) for p, part in zip(parts, left, strict=True)]
    )
