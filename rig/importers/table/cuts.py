"""Where the runs of a file begin: at gaps, laps, trials or marks, as the mapping states."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimation.recording import FloatArray
from rig.errors import DataError
from rig.importers.table.arrays import TRIAL
from rig.importers.table.mapping import ColumnMapping
from rig.importers.table.raw import Raw, find


def edges_of(raw: Raw, mapping: ColumnMapping, time_s: FloatArray) -> list[int]:
    """Return the first sample of each run of a file, and the end of the last one.

    Raises:
        DataError: The file has no such column as a rule names.
    """
    data = mapping.data
    rules = data.runs
    since_s = np.maximum.accumulate(time_s - time_s[0])
    begins = np.zeros(len(time_s), bool)
    steps = np.diff(time_s)
    if rules.gap_s is not None:
        begins[1:] |= steps > rules.gap_s
    if rules.resets:
        begins[1:] |= steps < 0
    for name in _of_trials(mapping):
        values = _cutting(raw, mapping, "changes", name)
        begins[1:] |= values[1:] != values[:-1]
    if rules.falls:
        begins[1:] |= np.diff(_cutting(raw, mapping, "falls", rules.falls).astype(float)) < 0
    if rules.mark:
        marked = _cutting(raw, mapping, "mark", rules.mark) != 0
        begins[1:] |= marked[1:] & ~marked[:-1]
    first = int(np.searchsorted(since_s, rules.start_s)) if rules.start_s > 0 else 0
    end = int(np.searchsorted(since_s, since_s[-1] - rules.tail_s, side="right"))
    begins[:first] = False
    at = [*rules.at_s]
    if rules.lap_s is not None:
        laps = np.arange(rules.start_s, since_s[-1] - rules.tail_s, rules.lap_s)
        at += laps.tolist()
    begins[[k for k in np.searchsorted(since_s, np.array(at) - 1e-9) if k < len(begins)]] = True
    return sorted({first, *np.flatnonzero(begins[:end]).tolist(), max(first, end)})


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
