"""How much one recorded reading changes with another, against the ratio that is stated."""

from collections.abc import Sequence

import numpy as np

from estimation.model import Model
from estimation.recording import Recording

FOLLOWS = 0.02
"""Share by which two readings of one travel may differ."""


def slope(
    recordings: Sequence[Recording], x: str, y: str, besides: Sequence[str] = ()
) -> float | None:
    """Return the change of channel y per change of x; None where x never moves.

    Runs without a channel are left out, and so is each run's mean. `besides` are other channels
    that y changes with, such as the torque that winds up a gearbox.
    """
    products = np.zeros((2 + len(besides), 2 + len(besides)))
    for recording in recordings:
        if all(name in recording for name in (x, *besides, y)):
            columns = np.column_stack([recording[name] for name in (x, *besides, y)])
            inside = columns[recording.valid] - columns[recording.valid].mean(axis=0)
            products += inside.T @ inside
    if not products[0, 0] > 0.0:
        return None
    sizes = np.sqrt(np.maximum(np.diag(products), np.finfo(float).tiny))
    scaled = products / np.outer(sizes, sizes)
    found = np.linalg.lstsq(scaled[:-1, :-1], scaled[:-1, -1], rcond=1e-10)[0]
    return float(found[0] * sizes[-1] / sizes[0])


def off_ratio(model: Model, recordings: Sequence[Recording]) -> str:
    """Return a sentence where a declared equation's deflection is none of its ratio, else nothing.

    A deflection is the difference of two readings, one of them over a stated ratio. With another
    ratio it is mostly travel, and a cause that explains it is none of the machine's.
    """
    combination = model.signals.combination(model.target)
    if combination is None or len(combination.shares) != 2 or combination.direction:
        return ""
    driving, driven = combination.shares
    if driving.gain * driven.gain >= 0.0:
        return ""
    stated = -driven.gain / driving.gain
    there = set.intersection(*(set(r.columns) for r in recordings)) if recordings else set()
    besides = [name for name in model.channels if name in there]
    found = slope(recordings, driven.channel, driving.channel, besides)
    if found is None or abs(found / stated - 1.0) <= FOLLOWS:
        return ""
    return (
        f"{driving.channel} changes {found:.4g} times as much as {driven.channel}, but the machine"
        f" states the ratio {stated:g}."
    )
