"""The angles and positions that the equations read, and which of them are of one shaft."""

from collections.abc import Sequence

import numpy as np

from estimation.causes.equations import Equation
from estimation.causes.layout import Layout
from estimation.causes.run_signals import ANGLES
from estimation.derived import measured_channels, origin_of
from estimation.signals import Combination, Signals

MOST_BEND = 0.1
"""Share of a joined axis' travel that may be the bend of what joins it."""


def travel_of(layout: Layout, position: str) -> float:
    """Return the largest travel of a position in any run."""
    return max(float(np.ptp(run.channels[position])) for run in layout.runs)


def angles_of(layout: Layout) -> list[str]:
    """Return the angles that the equations read, the one with the largest travel first.

    Those that follow by a known ratio come with them. Where they read none, the positions that the
    machine states are read. No other channel is ever read: another recorded channel may be a copy
    of a target.
    """
    read = set().union(*map(_read, layout.equations.values()))
    if not any(name.endswith(ANGLES) for name in read):
        read |= {*signals_of(layout).readings}
    agreeing = [_ends(one) for one in signals_of(layout).joined if _agrees(layout, one)]
    known = {*layout.measured, *(name for ends in agreeing for name in ends)}
    names = _grown(read & known, agreeing)
    angles = [name for name in names if name.endswith(ANGLES)]
    stated = [name for name in angles if name in signals_of(layout).readings]
    if stated:  # a formula in metres is no position
        moving = {*stated, *signals_of(layout).integrals, *(n for ends in agreeing for n in ends)}
        angles = [name for name in angles if name in moving]
    return sorted(angles, key=lambda name: (-travel_of(layout, name), name))  # a set has no order


def _agrees(layout: Layout, joined: Combination) -> bool:
    """Whether a position was recorded or derived, and moves as its neighbour and the ratio give."""
    (share,) = joined.shares
    if not all({joined.name, share.channel} <= {*run.channels} for run in layout.runs):
        return False
    channels = [run.channels for run in layout.runs]
    moved = sum(float(np.var(c[joined.name])) for c in channels)
    bent = sum(float(np.var(c[joined.name] - share.gain * c[share.channel])) for c in channels)
    return bent < MOST_BEND**2 * moved


def groups_apart(layout: Layout) -> int:
    """Return the number of groups of equations that share no reading, as the joints of an arm."""
    groups: list[set[str]] = []
    for equation in layout.equations.values():
        read = _read(equation) - {"time_s"}
        shared = [g for g in groups if g & read]
        groups = [g for g in groups if not g & read] + [read.union(*shared)]
    return len(groups)


def related(layout: Layout, equation: Equation, angles: Sequence[str]) -> list[str]:
    """Return the angles that equations relate to those an equation reads: of the same shafts.

    Every angle, where it reads none.
    """
    own = _read(equation).intersection(angles)
    known = _grown(own, [one.intersection(angles) for one in _together(layout)])
    return [a for a in angles if a in known] or list(angles)


def unrelated(layout: Layout, equation: Equation, angles: Sequence[str]) -> tuple[str, ...]:
    """Return the angles that no equation relates to those of an equation: of other joints."""
    own = _read(equation).intersection(angles)
    there = set().union(*(one for one in _together(layout) if one & own))
    return tuple(a for a in angles if a not in there)


def _together(layout: Layout) -> list[set[str]]:
    """Return the channels that each equation reads, and the positions at each joint's ends."""
    read = [_read(equation) for equation in layout.equations.values()]
    return [*read, *map(_ends, signals_of(layout).joined)]


def _grown(names: set[str], together: Sequence[set[str]]) -> set[str]:
    """Return names with all that stand together with one of them, directly or through others."""
    known: set[str] = set()
    while names > known:
        known = names
        names = known.union(*(one for one in together if one & known))
    return known


def _ends(joined: Combination) -> set[str]:
    return {joined.name, *(share.channel for share in joined.shares)}


def _read(equation: Equation) -> set[str]:
    """Return the readings of an equation, and the positions of the speeds that a tachometer reads.

    The integral of such a speed is not a position of the shaft: a neighbour's encoder gives it.
    """
    model, read = equation.model, set[str]()
    joined = {one.name for one in model.signals.joined}
    for name in (equation.target, *model.channels):
        position = origin_of(name)[0]
        is_followed = position in joined and model.signals.combination(name) is not None
        read |= {position} if is_followed else {*measured_channels([name], model.signals)}
    return read


def signals_of(layout: Layout) -> Signals:
    """Return the signals of the machine that the equations are of."""
    return next(iter(layout.equations.values())).model.signals
