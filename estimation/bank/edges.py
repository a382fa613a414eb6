"""Runs at the lowest and the highest level of a condition: what lies beyond those fitted.

Runs left out at random are surrounded by runs like them, so their errors are smaller than those on
a condition nobody has fitted. The extreme levels of the conditions at hand, left out in turn, are
the nearest thing to a new one: blocked cross-validation, D. R. Roberts et al., "Cross-validation
strategies for data with temporal, spatial, hierarchical, or phylogenetic structure", Ecography 40
(2017).
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

LEAST_LEVELS = 3
"""With two levels, the effect of the condition cannot be fitted after leaving one out."""


def edges(
    conditions: Sequence[Mapping[str, float | str]], least_left: int
) -> list[NDArray[np.int_]]:
    """Return the runs at each extreme level of each condition that was varied on purpose.

    A condition counts if every run states a number and its levels repeat: an encoder's zero, which
    is another number in each run, does not.

    Args:
        conditions: Conditions of each run.
        least_left: Runs that must be left when those at a level are left out.
    """
    found = []
    names = set.intersection(*(set(held) for held in conditions)) if conditions else set()
    for name in sorted(names):
        stated = [held[name] for held in conditions]
        if any(isinstance(value, str) for value in stated):
            continue
        values = np.array([float(value) for value in stated])
        levels = np.unique(values)
        if LEAST_LEVELS <= len(levels) <= len(values) / 2:
            for level in (levels[0], levels[-1]):
                at = np.flatnonzero(values == level)
                if len(values) - len(at) >= least_left:
                    found.append(at)
    return found
