"""The audit before a search: clocks that jump or skip, and conditions that never vary.

A run whose clock jumps is left out: filters take samples as evenly spaced, and across a gap that
nobody flagged they join samples that were apart, which looks like a fast motion without a torque.
All else decides nothing; its sentences are the limits of a search on these runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimation.recording import Recording, shared_columns


@dataclass(frozen=True)
class _Gap:
    """A step of a clock that is longer than a period: time of its begin, length, and if it jumps.

    It jumps where it is long enough to hide a reversal and no sample at its ends is flagged.
    """

    at_s: float
    length_s: float
    jumps: bool


def _gaps(recording: Recording, long_s: float = 0.05) -> list[_Gap]:
    """Return the gaps of a run's clock, in order."""
    steps = np.diff(recording.time_s)
    usual = float(np.median(steps)) if steps.size else 0.0
    flagged = recording.flags != 0
    jumps = ~(flagged[:-1] | flagged[1:]) & (steps > usual + long_s)
    return [
        _Gap(float(recording.time_s[k]), float(steps[k]), bool(jumps[k]))
        for k in np.flatnonzero(steps > 1.5 * usual)
    ]


def steady(recordings: Sequence[Recording]) -> tuple[list[Recording], list[str]]:
    """Return the runs whose clock does not jump, and a sentence on each other run."""
    kept, lost = [], []
    for recording in recordings:
        jumps = [gap for gap in _gaps(recording) if gap.jumps]
        if not jumps:
            kept.append(recording)
            continue
        more = "" if len(jumps) == 1 else f", and at {len(jumps) - 1} more places"
        lost.append(
            f"Run {recording.name} is left out: its clock jumps by {jumps[0].length_s:.3g} s at"
            f" {jumps[0].at_s:.3f} s{more}, and the motion meanwhile is not known."
        )
    return kept, lost


def audit(recordings: Sequence[Recording]) -> list[str]:
    """Return the limits that the clocks and the conditions of used runs set, one sentence each."""
    said = []
    for recording in recordings:
        if found := _gaps(recording):
            longest = max(found, key=lambda gap: gap.length_s)
            said.append(
                f"The clock of run {recording.name} skips {len(found)} times, the longest by"
                f" {longest.length_s:.3g} s at {longest.at_s - recording.time_s[0]:.3g} s:"
                " an effect of time or history is not decided across it."
            )
    return said + [line for name in shared_columns(recordings) if (line := _held(name, recordings))]


def _held(name: str, recordings: Sequence[Recording], steady: float = 1e-3) -> str:
    """Return a sentence on a channel that varies in no run by more than a share of its size."""
    spans = [float(np.ptp(r[name])) for r in recordings]
    size = max(float(np.max(np.abs(r[name]))) for r in recordings)
    if not np.isfinite(spans).all() or max(spans) > steady * size:
        return ""
    levels = {round(float(np.mean(r[name])) / max(size, 1e-300), 3) for r in recordings}
    held = "never varies" if len(levels) == 1 else "is held within each run"
    return f"{name} {held}: an effect that depends on it is not decided within a run."
