"""Exchanges between training and test runs where a stated condition is missing in one of them.

Runs sorted by their conditions are stratified over the first of them alone. Where a level of some
condition has enough runs and none of them is on one side, runs are exchanged, each time the two
after which the levels are shared best.
"""

from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

Levels = Mapping[str, str | float]
"""What was held constant in a run: condition to value."""

THIRDS = 3
"""Most parts of the range of a condition that has too few runs of each level: low, middle, high."""


def shared(
    levels: Mapping[str, Levels],
    held: Collection[str],
    least: int,
    allowed: Callable[[Collection[str]], bool],
) -> set[str]:
    """Return the test runs, exchanged until each part has the levels of which there are enough.

    Args:
        levels: The conditions of each run that may be a test run.
        held: The test runs.
        least: Runs of a level that are enough.
        allowed: Whether runs may be the test runs.
    """
    names = sorted(levels)
    inside = _groups([levels[name] for name in names], least)
    tested = np.array([name in held for name in names])
    while _cost(inside, tested[None], least)[0] >= 1.0:
        found = _exchange(inside, tested, names, least, allowed)
        if found is None:
            break
        tested = found
    return {name for name, is_tested in zip(names, tested, strict=True) if is_tested}


def _exchange(
    inside: NDArray[np.bool_],
    tested: NDArray[np.bool_],
    names: Sequence[str],
    least: int,
    allowed: Callable[[Collection[str]], bool],
) -> NDArray[np.bool_] | None:
    """Return the test runs after the best exchange of two runs; None where none is better."""
    pairs = [(i, j) for i in np.flatnonzero(tested) for j in np.flatnonzero(~tested)]
    tried = np.repeat(tested[None], len(pairs), axis=0)
    for row, (i, j) in zip(tried, pairs, strict=True):
        row[i], row[j] = False, True
    costs, now = _cost(inside, tried, least), _cost(inside, tested[None], least)[0]
    for k in np.argsort(costs, kind="stable"):
        if costs[k] >= now - 1e-9:
            return None
        if allowed([name for name, is_tested in zip(names, tried[k], strict=True) if is_tested]):
            return np.asarray(tried[k])
    return None


def _cost(inside: NDArray[np.bool_], tested: NDArray[np.bool_], least: int) -> NDArray[np.float64]:
    """Return for each choice of test runs the levels missing in a part, plus a share below 1.

    The share is larger the less evenly the levels are shared.
    """
    sizes = inside.sum(axis=0)
    counts = tested.astype(int) @ inside.astype(int)
    missing = ((counts == 0) | (counts == sizes)) & (sizes >= least)
    due = tested.sum(axis=1, keepdims=True) * sizes / len(inside)
    uneven = ((counts - due) ** 2 / np.maximum(due, 1e-9)).sum(axis=1)
    return np.asarray(missing.sum(axis=1) + uneven / (1.0 + uneven))


def _groups(levels: Sequence[Levels], least: int) -> NDArray[np.bool_]:
    """Return which run is of which level of which condition, shape (runs, levels).

    Numbers of which too few runs are alike count as low or high, or between.
    """
    columns = [np.zeros(len(levels), bool)]
    for key in sorted({key for own in levels for key in own}):
        values = [own.get(key) for own in levels]
        numbers = [float(v) for v in values if isinstance(v, int | float)]
        alike = min((numbers.count(n) for n in numbers), default=0)
        if len(numbers) == len(values) and alike < least:
            ranks = np.searchsorted(np.sort(numbers), numbers)
            # in so many neighbours there is a whole stratum of the sorted runs
            parts = min(THIRDS, len(levels) // (2 * least - 1))
            values = [parts * int(rank) // len(levels) for rank in ranks]
        columns += [np.array([v == one for v in values]) for one in dict.fromkeys(values)]
    return np.column_stack(columns)
