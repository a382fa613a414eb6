"""Folds: what a cause must predict without having been fitted on it.

A proxy predicts in the conditions at hand and fails in those that are left out. A cause holds in
both (invariant prediction: Peters, Buehlmann and Meinshausen 2016).
"""

from collections.abc import Sequence

import numpy as np

from estimation.causes.equations import EFFORTS, Layout

Folds = Sequence[Sequence[Sequence[int]]]
"""Families of folds; a fold is the runs that are left out together."""


def folds_of(layout: Layout) -> list[list[list[int]]]:
    """Return families of folds: each run, and each level of every condition.

    The levels of the loads and of the speed come from the data.
    """
    runs = layout.runs
    families = [[[k] for k in range(len(runs))]]
    found = [_levels(values) for values in _conditions(layout).values()]
    unique: list[list[list[int]]] = []
    for levels in found:
        if levels and levels not in unique:
            unique.append(levels)
    return families + unique


def unvaried(layout: Layout) -> list[str]:
    """Return the channels of the conditions that are alike in all runs."""
    return [name for name, values in _conditions(layout).items() if not _varies(values)]


def _conditions(layout: Layout) -> dict[str, list[float]]:
    """Return channel to the level of that condition in each run."""
    out = {}
    for equation in layout.equations.values():
        if equation.of_angle:
            continue
        for name in (*equation.channels, equation.target):
            if name.endswith(EFFORTS):
                out[name] = [float(r.on_grid(name).mean()) for r in layout.runs]
                break
    speeds = [e.speed for e in layout.equations.values() if e.speed]
    if speeds:
        out[speeds[0]] = [
            float(np.percentile(np.abs(r.on_grid(speeds[0])), 95)) for r in layout.runs
        ]
    return out


def _levels(values: Sequence[float], count: int = 3) -> list[list[int]]:
    """Return runs by the level of a condition; empty of few runs, or where it does not vary."""
    array = np.asarray(values)
    if len(array) < 2 * count or not _varies(values):
        return []
    spread = float(np.ptp(array))
    order = np.argsort(array, kind="stable")
    gaps = np.sort(np.argsort(-np.diff(array[order]), kind="stable")[: count - 1]) + 1
    if array[order][gaps].size and np.diff(array[order])[gaps - 1].min() > 0.15 * spread:
        groups = np.split(order, gaps)  # levels that were set
    else:
        groups = np.array_split(order, count)
    if max(map(len, groups)) > 0.6 * len(array):
        groups = np.array_split(order, count)
    return [sorted(int(i) for i in g) for g in groups]


def _varies(values: Sequence[float]) -> bool:
    array = np.asarray(values)
    return float(np.ptp(array)) > 0.1 * float(np.abs(array).mean())
