"""The angles and positions that the equations read, and which of them are of one shaft."""

from collections.abc import Sequence

import numpy as np

from estimation.causes.equations import ANGLES, Equation, Layout
from estimation.derived import measured_channels
from estimation.signals import Combination, Signals

MOST_BEND = 0.1
"""Share of a joined axis' travel that may be the bend of what joins it."""


def travel_of(layout: Layout, position: str) -> float:
    """Return the largest travel of a position in any run."""
    return max(float(np.ptp(run.channels[position])) for run in layout.runs)


def angles_of(layout: Layout) -> list[str]:
    """Return the angles that the equations read, the one with the largest travel first.

    Those that follow by a known ratio come with them. No other channel is ever read: another
    recorded channel may be a copy of a target.
    """
    signals = signals_of(layout)
    read = [n for e in layout.equations.values() for n in (e.target, *e.model.channels)]
    names = {n for n in measured_channels(read, signals) if n in layout.measured}
    for one in (c for c in signals.joined for _ in signals.joined):  # along a chain
        both = {one.name, one.shares[0].channel}
        if names & both and _agrees(layout, one):
            names |= both
    return sorted((n for n in names if n.endswith(ANGLES)), key=lambda n: -travel_of(layout, n))


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
    read = [_read(e) & {*angles} for e in layout.equations.values()]
    read += [{c.name, c.shares[0].channel} & {*angles} for c in signals_of(layout).joined]
    known: set[str] = set()
    grown = _read(equation) & {*angles}
    while grown > known:
        known = grown
        grown = known.union(*(r for r in read if r & known))
    return [a for a in angles if a in known] or list(angles)


def unrelated(layout: Layout, equation: Equation, angles: Sequence[str]) -> tuple[str, ...]:
    """Return the angles that no equation relates to those of an equation: of other joints."""
    own = _read(equation)
    read = [_read(e) for e in layout.equations.values()]
    read += [{c.name, c.shares[0].channel} for c in signals_of(layout).joined]
    there = set().union(*(r for r in read if r & own & set(angles)))
    return tuple(a for a in angles if a not in there)


def _read(equation: Equation) -> set[str]:
    model = equation.model
    return {*measured_channels([equation.target, *model.channels], model.signals)}


def signals_of(layout: Layout) -> Signals:
    """Return the signals of the machine that the equations are of."""
    return next(iter(layout.equations.values())).model.signals
