"""The audit before a search: clocks that jump or skip, and conditions that never vary.

A run whose clock jumps is left out: filters take samples as evenly spaced, and across a gap that
nobody flagged they join samples that were apart, which looks like a fast motion without a torque.
All else decides nothing; its sentences are the limits of a search on these runs.
"""

from collections.abc import Sequence, Set

import numpy as np
from numpy.typing import NDArray

from estimation.derived import CLOCKS
from estimation.recording import FloatArray, Recording, shared_columns

MANY, MOST_NAMED = 0.01, 6
"""Share of a run's flagged samples from which it is named, and the most runs that are."""


def _gaps(recording: Recording) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Return begin and length of the gaps of a run's clock, s, and which of them are jumps.

    A jump is long enough to hide a reversal, and no sample at its ends is flagged.
    """
    steps = np.diff(recording.time_s)
    usual = float(np.median(steps)) if steps.size else 0.0
    at = np.flatnonzero(steps > 1.5 * usual)
    flagged = (recording.flags[at] != 0) | (recording.flags[at + 1] != 0)
    return recording.time_s[at], steps[at], ~flagged & (steps[at] > usual + 0.05)


def steady(recordings: Sequence[Recording]) -> tuple[list[Recording], list[str]]:
    """Return the runs whose clock does not jump, and a sentence on each other run."""
    kept, lost = [], []
    for recording in recordings:
        begins, lengths, jumps = _gaps(recording)
        if not jumps.any():
            kept.append(recording)
            continue
        first, more = int(np.argmax(jumps)), int(jumps.sum()) - 1
        lost.append(
            f"Run {recording.name} is left out: its clock jumps by {lengths[first]:.3g} s at"
            f" {begins[first]:.3f} s{f', and at {more} more places' if more else ''}, and the"
            " motion meanwhile is not known."
        )
    return kept, lost


def flagged(recordings: Sequence[Recording]) -> list[str]:
    """Return a sentence on the runs of which many samples are flagged, or nothing."""
    counts = {r.name: int((~r.valid).sum()) for r in recordings}
    many = [r for r in recordings if counts[r.name] > MANY * len(r)]
    shown = ", ".join(f"{counts[r.name]} of {len(r)} in {r.name}" for r in many[:MOST_NAMED])
    more = f" and in {len(many) - MOST_NAMED} other runs" if len(many) > MOST_NAMED else ""
    return [f"Samples that are flagged and do not count: {shown}{more}."] if many else []


def audit(recordings: Sequence[Recording], read: Set[str] = frozenset()) -> list[str]:
    """Return the limits that the clocks and the conditions of used runs set, one sentence each.

    What an effect that was found reads is not a limit: between runs it was decided. Nor is a stated
    condition that differs, which competes with it.
    """
    said = _skipping(recordings)
    others = [name for name in shared_columns(recordings) if name not in {*read, *CLOCKS}]
    return said + [line for name in others if (line := _held(name, recordings))]


def _skipping(recordings: Sequence[Recording]) -> list[str]:
    """Return a sentence on the runs whose clock skips, or nothing."""
    runs = [(r, *_gaps(r)[:2]) for r in recordings]
    runs = [one for one in runs if one[1].size]
    if not runs:
        return []
    worst, begins, lengths = max(runs, key=lambda one: float(one[2].max()))
    k = int(np.argmax(lengths))
    times = sum(len(found) for _, found, _ in runs)
    where = f"run {worst.name}" if len(runs) == 1 else f"{len(runs)} runs"
    place = f"{begins[k] - worst.time_s[0]:.3g} s" + ("" if len(runs) == 1 else f" of {worst.name}")
    return [
        f"The clock of {where} skips {times} time{'s' if times > 1 else ''}, the longest by"
        f" {lengths[k]:.3g} s at {place}: an effect of time or history is not decided across it."
    ]


def _held(name: str, recordings: Sequence[Recording], steady: float = 1e-3) -> str:
    """Return a sentence on a channel that varies in no run by more than a share of its size."""
    spans = [float(np.ptp(r[name])) for r in recordings]
    size = max(float(np.max(np.abs(r[name]))) for r in recordings)
    if not np.isfinite(spans).all() or max(spans) > steady * size:
        return ""
    levels = {round(float(np.mean(r[name])) / max(size, 1e-300), 3) for r in recordings}
    if len(levels) == 1:
        return f"{name} never varies: these runs do not show an effect that depends on it."
    if all(name in r.conditions for r in recordings):
        return ""
    return (
        f"{name} is held within each run: an effect that depends on it shows between runs alone,"
        " where all else that differs between them shows, too."
    )
