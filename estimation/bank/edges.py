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


ALIKE = 0.01
"""Levels that differ by less than this share are one: files round what was commanded."""


def edges(
    conditions: Sequence[Mapping[str, float | str]], least_left: int
) -> list[NDArray[np.int_]]:
    """Return the runs at each extreme level of each condition that was varied on purpose.

    A condition counts if every run states a number and its levels repeat: an encoder's zero, which
    is another number in each run, does not. At least `least_left` runs are left without a level's.
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


def only_levels(conditions: Sequence[Mapping[str, float | str]]) -> dict[str, float]:
    """Return the level of each condition that all runs have alike.

    Nothing in such runs shows what another level changes.
    """
    first = conditions[0] if conditions else {}
    stated = {name: float(v) for name, v in first.items() if not isinstance(v, str)}
    return {
        name: level
        for name, level in sorted(stated.items())
        if all(name in held and not other_levels({name: level}, held) for held in conditions)
    }


def other_levels(
    only: Mapping[str, float], conditions: Mapping[str, float | str]
) -> dict[str, float]:
    """Return the conditions of a run that differ from the only level fitted, with the run's level.

    A condition that the run does not state does not differ.
    """
    stated = {k: float(v) for k, v in conditions.items() if k in only and not isinstance(v, str)}
    return {
        name: value for name, value in stated.items() if not np.isclose(value, only[name], ALIKE)
    }
