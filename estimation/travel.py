"""How much one recorded reading changes with another, against the ratio that is stated."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimation.derived import rates_of, zero_phase_channels
from estimation.filters import FilterError, LowPass
from estimation.model import Model
from estimation.recording import Recording
from estimation.signals import Signals
from estimation.unit_factors import off_by

FOLLOWS = 0.02
"""Share by which two readings of one travel may differ."""

OWN, CLEAR = 0.01, 2.0
"""Share of a travel's square that its rates must not explain, since of one frequency they are the
travel; and the travel that a stated ratio is wrong by over what nothing explains, at least."""


class Slope(NamedTuple):
    """The change of y per change of x besides other channels."""

    value: float
    own: float  # share of the square of x that the other channels do not explain
    moved: float  # root mean square of x over that of what nothing explains, in units of y


def slope(
    recordings: Sequence[Recording], x: str, y: str, besides: Sequence[str] = ()
) -> float | None:
    """Return the change of channel y per change of x; None where x never moves.

    Runs without a channel are left out, and so is each run's mean. `besides` are other channels
    that y changes with, such as the torque that winds up a gearbox.
    """
    found = _slope(recordings, x, y, besides)
    return None if found is None else found.value


def _slope(recordings: Sequence[Recording], x: str, y: str, besides: Sequence[str]) -> Slope | None:
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
    left = max(1.0 - float(found @ scaled[:-1, -1]), np.finfo(float).eps)
    others = np.linalg.lstsq(scaled[1:-1, 1:-1], scaled[1:-1, 0], rcond=1e-10)[0]
    own = 1.0 - float(others @ scaled[1:-1, 0])
    over = float(sizes[0] / sizes[-1])
    return Slope(float(found[0]) / over, own, over / math.sqrt(left))


def other_ratio(
    recordings: Sequence[Recording],
    ends: tuple[str, str],
    stated: float,
    efforts: Sequence[str],
    low_pass: LowPass,
    signals: Signals,
) -> float | None:
    """Return the ratio of a flexible transmission's ends where it is not the stated one, else None.

    The ends are the positions of the driving and of the driven one, the ratio the change of the
    first per change of the second. What is between them bends with the effort on the driven end.
    Where the sensor of effort is beyond a mass, or there is none, it bends with that mass and its
    damping too: with the acceleration and the speed of the driven end.
    """
    driving, driven = ends
    besides = [*efforts, *rates_of(driven)]
    there = [r for r in recordings if all(name in r for name in (*ends, *efforts))]
    try:
        moving = [zero_phase_channels(r, [*ends, *besides], low_pass, signals) for r in there]
        found = _slope(moving, driven, driving, besides)
    except FilterError:  # a run too short for the filter
        found = None
    if found is None or found.own < OWN:
        plain = slope(there, driven, driving, efforts)
        return None if plain is None or abs(plain / stated - 1.0) <= FOLLOWS else plain
    off = abs(found.value - stated)
    return found.value if off > FOLLOWS * abs(stated) and off * found.moved > CLEAR else None


def off_ratio(model: Model, recordings: Sequence[Recording]) -> str:
    """Return a sentence where a declared equation's deflection is none of its ratio, else nothing.

    A deflection is the difference of two readings, one of them over a stated ratio. With another
    ratio it is mostly travel, and a cause that explains it is none of the machine's.
    """
    combination = model.signals.combination(model.target)
    if combination is None or len(combination.shares) != 2 or combination.direction:
        return ""
    driving, driven = combination.shares
    if driving.gain * driven.gain >= 0.0 or not rates_of(driven.channel):
        return ""  # a sum, or a difference of what is not a travel, such as two pressures
    stated = -driven.gain / driving.gain
    there = set.intersection(*(set(r.columns) for r in recordings)) if recordings else set()
    besides = [name for name in model.channels if name in there]
    ends = driving.channel, driven.channel
    found = other_ratio(recordings, ends, stated, besides, model.low_pass, model.signals)
    if found is None:
        return ""
    return (
        f"{driving.channel} changes {found:.4g} times as much as {driven.channel}, but the machine"
        f" states the ratio {stated:g}.{off_by(found / stated)}"
    )
