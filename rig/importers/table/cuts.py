"""Where the runs of a file begin: at gaps, laps, trials or marks, as the mapping states."""

import re
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from estimation.recording import FloatArray
from rig.errors import DataError
from rig.importers.table.arrays import TRIAL
from rig.importers.table.mapping import ColumnMapping
from rig.importers.table.raw import Raw, find

FEW = 10
"""Samples below which a part cannot be filtered by any zero-phase filter."""

LISTED, SHARE = 12, 0.1
"""Parts with fewer samples that a person still sees in the list of runs, and the share of all
samples in such parts that is too much in any case."""


def edges_of(raw: Raw, mapping: ColumnMapping, time_s: FloatArray) -> list[int]:
    """Return the first sample of each run of a file, and the end of the last one.

    Raises:
        DataError: The file has no such column as a rule names.
    """
    data = mapping.data
    rules = data.runs
    since_s = np.maximum.accumulate(time_s - time_s[0])
    begins = np.zeros(len(time_s), bool)
    for _, cuts in _rules(raw, mapping, time_s):
        begins[1:] |= cuts
    first = int(np.searchsorted(since_s, rules.start_s)) if rules.start_s > 0 else 0
    end = int(np.searchsorted(since_s, since_s[-1] - rules.tail_s, side="right"))
    begins[:first] = False
    at = [*rules.at_s]
    if rules.lap_s is not None:
        laps = np.arange(rules.start_s, since_s[-1] - rules.tail_s, rules.lap_s)
        at += laps.tolist()
    begins[[k for k in np.searchsorted(since_s, np.array(at) - 1e-9) if k < len(begins)]] = True
    return sorted({first, *np.flatnonzero(begins[:end]).tolist(), max(first, end)})


def _rules(
    raw: Raw, mapping: ColumnMapping, time_s: FloatArray
) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Yield each rule that reads a column, in words, and where it begins a run, shape (n - 1,)."""
    rules = mapping.data.runs
    steps = np.diff(time_s)
    if rules.gap_s is not None:
        yield f"a pause of more than {rules.gap_s:g} s", steps > rules.gap_s
    if rules.resets:
        yield "a time that goes back", steps < 0
    for name in _of_trials(mapping):
        values = _cutting(raw, mapping, "changes", name)
        yield f"a new value of {name!r}", values[1:] != values[:-1]
    if rules.falls:
        values = _cutting(raw, mapping, "falls", rules.falls).astype(float)
        yield f"a fall of {rules.falls!r}", np.diff(values) < 0
    if rules.mark:
        marked = _cutting(raw, mapping, "mark", rules.mark) != 0
        yield f"a mark of {rules.mark!r}", marked[1:] & ~marked[:-1]


def torn(
    raw: Raw, mapping: ColumnMapping, time_s: FloatArray, edges: Sequence[int]
) -> tuple[str, str, str] | None:
    """Return that a file is cut into many tiny parts, the reason and the remedy; None if it is not.

    The rows of two trials that alternate are cut at each of them. With a shortest run that is
    stated, most parts may be shorter.
    """
    sizes = np.diff(edges)
    tiny = sizes[sizes < FEW]
    share = float(tiny.sum() / max(sizes.sum(), 1))
    most = mapping.data.runs.least_s is None and len(tiny) > len(sizes) / 2
    if len(tiny) <= LISTED or not (most or share > SHARE):
        return None
    rules = [*_rules(raw, mapping, time_s)]  # their columns are read once more, to name the one
    if not rules:
        return None
    rule = max(rules, key=lambda one: np.count_nonzero(one[1]))[0]
    names = [name for name in _of_trials(mapping) if rule == f"a new value of {name!r}"]
    by = f"by {names[0]!r}" if names else "by their run"
    return (
        f"{raw.path.name} is cut into {len(sizes)} parts, {len(tiny)} of them of fewer than {FEW}"
        f" samples, {share:.1%} of all.",
        f"Most cuts are at {rule}.",
        f"If rows of several trials alternate, sort the file {by}, then by time. If not, correct"
        f" {mapping.where('runs')}; least_s = 1 there states that parts below 1 s are left out.",
    )


def labels_of(raw: Raw, mapping: ColumnMapping, begins: Sequence[int]) -> list[str]:
    """Return the trial of each run, as the run is named by it.

    Empty where not one column states it, or where two runs would have the same name.
    """
    names = _of_trials(mapping)
    if len(names) != 1:
        return []
    found = [_cutting(raw, mapping, "changes", names[0])[place] for place in begins]
    if all(isinstance(x, np.number) and float(x).is_integer() for x in found):
        width = max(2, *(len(f"{x:.0f}") for x in found))
        labels = [f"{float(x):0{width}.0f}" for x in found]
    else:
        labels = [re.sub(r"[^\w.]+", "-", str(x)).strip("-").lower() for x in found]
    return labels if all(labels) and len({*labels}) == len(labels) else []


def _of_trials(mapping: ColumnMapping) -> list[str]:
    """Return the columns a new value of which begins a run."""
    return [*mapping.data.runs.changes, *([TRIAL] if mapping.data.trials else [])]


def _cutting(raw: Raw, mapping: ColumnMapping, rule: str, name: str) -> NDArray[np.generic]:
    where = mapping.where("runs", rule)
    found = find(raw, where, rule, name)
    if not isinstance(found, np.ndarray):
        raise DataError(
            f"{where}: {name!r} of {raw.path.name} is one value, so it cuts nothing.",
            fix="Name a column.",
        )
    return found
