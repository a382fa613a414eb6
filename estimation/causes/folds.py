"""Folds: what a cause must predict without having been fitted on it.

A proxy predicts in the conditions at hand and fails in those that are left out. A cause holds in
both (invariant prediction: Peters, Buehlmann and Meinshausen 2016).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimation.causes.layout import Layout
from estimation.causes.run_signals import EFFORTS
from estimation.recording import FloatArray

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


def _levels(values: Sequence[float], most: int = 3) -> list[list[int]]:
    """Return runs by the level of a condition; empty of few runs, or where it does not vary.

    Levels that were set stay whole; more than can be left out are grouped with their neighbours.
    """
    array = np.asarray(values)
    if len(array) < 2 * most or not _varies(values):
        return []
    order = np.argsort(array, kind="stable")
    levels = _set_levels(array[order])
    if len(levels) > most:
        of_parts = np.array_split(np.arange(len(levels)), most)
        levels = [np.concatenate([levels[k] for k in part]) for part in of_parts]
    if not levels or max(map(len, levels)) > 0.6 * len(array):
        levels = np.array_split(np.arange(len(array)), most)
    return [sorted(int(i) for i in order[level]) for level in levels]


def _set_levels(ordered: FloatArray) -> list[NDArray[np.intp]]:
    """Return the places of the runs of each level that was set; empty where none were.

    Levels have two runs at least and are further apart than the values at any of them; of several
    ways the clearest.
    """
    steps, best, clearest = np.diff(ordered), list[NDArray[np.intp]](), 1.0
    widest = np.argsort(-steps, kind="stable") + 1
    for count in range(2, len(ordered) // 2 + 1):
        parts = np.split(np.arange(len(ordered)), np.sort(widest[: count - 1]))
        within = max(float(np.ptp(ordered[part])) for part in parts)
        apart = float(steps[widest[count - 2] - 1])
        if min(map(len, parts)) > 1 and apart > clearest * within:
            best, clearest = parts, apart / within if within else np.inf
    return best


def _varies(values: Sequence[float]) -> bool:
    array = np.asarray(values)
    return float(np.ptp(array)) > 0.1 * float(np.abs(array).mean())
