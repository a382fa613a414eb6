"""Channels that stand still in a few runs while the machine moves, as questions in words."""

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from estimation.channels import unit_of
from estimation.recording import FloatArray, Recording, shared_columns
from rig.importers.apart import FAR, LEAST, MOST, MOTIONS, POSITIONS

READ = (*MOTIONS, "N", "N m", "A")
"""Units of what changes where a machine moves; a drive in volts or a ratio may be held."""

LONGEST_S = 0.5
"""Time that a channel may stand still in any case."""

MOVES = 0.1
"""Share of its range by which a position moves where the machine does."""

FOLLOWS = 0.9
"""Correlation from which one motion follows another, so that both move or neither does."""


COMMAND = re.compile(r"(^|_)(command|target)_")
"""In the name of a channel that was commanded, not measured: it may be held constant."""


class _Still(NamedTuple):
    """The longest time for which a channel of a run stands still while the machine moves, s."""

    run: str
    since_s: float
    length_s: float


def frozen(recordings: Sequence[Recording]) -> Iterator[str]:
    """Yield which channels stand still in a few runs while the machine moves, in words.

    In most runs they do not for a fifth of that time. A motion is compared with those that it
    follows: axes may move one at a time. A run at an end of the channel's range may be clipped.
    """
    recordings = [run for run in recordings if len(run) >= LEAST]
    shared = shared_columns(recordings) if recordings else ()
    names = [n for n in shared if unit_of(n) in READ and not COMMAND.search(n)]
    ranges = {n: _range(recordings, n) for n in names}
    moving = [n for n in names if unit_of(n) in POSITIONS and np.ptp(ranges[n]) > 0.0]
    for name in names:
        others = [n for n in moving if n != name and _may_show(n, name, recordings)]
        found = [_longest(run, name, others, ranges) for run in recordings] if others else []
        if not found:
            continue
        usual = float(np.quantile([one.length_s for one in found], MOST))
        far = [one for one in found if one.length_s > max(LONGEST_S, FAR * usual)]
        if far:
            places = ", ".join(
                f"{one.run} from {one.since_s:.4g} to {one.since_s + one.length_s:.4g} s"
                for one in far
            )
            yield (
                f"{name}: it stands still in {places} while {others[0]} moves; was its reading"
                f" frozen? If so, --exclude {far[0].run}, or flag the time: [[data.invalid]]"
            )


def _range(recordings: Sequence[Recording], name: str) -> FloatArray:
    values = np.concatenate([run[name][run.valid] for run in recordings])
    values = values[np.isfinite(values)]
    return np.array([values.min(), values.max()]) if values.size else np.zeros(2)


def _may_show(moving: str, name: str, recordings: Sequence[Recording]) -> bool:
    """Whether a position that moves shows that a channel should: a motion must follow it."""
    if unit_of(name) not in MOTIONS:
        return True
    found = []
    for run in recordings:
        pair = np.array([run[moving], run[name]])[:, run.valid]
        if unit_of(name) not in POSITIONS:
            pair[0] = np.gradient(pair[0])
        pair = pair[:, np.isfinite(pair).all(axis=0)]
        if pair.shape[1] >= LEAST and (np.ptp(pair, axis=1) > 0.0).all():
            found.append(abs(float(np.corrcoef(pair)[0, 1])))
    return bool(found) and float(np.median(found)) > FOLLOWS


def _longest(
    run: Recording, name: str, others: Sequence[str], ranges: dict[str, FloatArray]
) -> _Still:
    """Return the longest time for which a channel stands still while one of the others moves."""
    values, time_s = run[name], run.time_s
    edges = np.flatnonzero(np.diff(values, prepend=np.nan, append=np.nan) != 0.0)
    first, last = edges[:-1], edges[1:] - 1
    length_s = time_s[last] - time_s[first]
    # a shorter one makes no difference to the usual time
    counts = (length_s > LONGEST_S / FAR) & (last - first + 1 < len(run))
    counts &= ~np.isin(values[first], ranges[name])
    for place in sorted(np.flatnonzero(counts).tolist(), key=lambda k: -length_s[k]):
        still = slice(first[place], last[place] + 1)
        moved = [np.ptp(run[n][still]) / np.ptp(ranges[n]) for n in others]
        if run.valid[still].all() and max(moved) > MOVES:
            return _Still(run.name, float(time_s[first[place]]), float(length_s[place]))
    return _Still(run.name, 0.0, 0.0)
