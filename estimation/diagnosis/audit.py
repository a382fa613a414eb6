"""The audit before a search: clocks that jump or skip, and conditions that never vary.

A run whose clock jumps is left out: filters take samples as evenly spaced, and across a gap that
nobody flagged they join samples that were apart, which looks like a fast motion without a torque.
All else decides nothing; its sentences are the limits of a search on these runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimation.recording import Recording, shared_columns

STEADY = 1e-3
"""A condition that varies by less than this share of its size is held."""

SKIP = 1.5
"""A step of the clock longer than so many periods is a gap."""

LONGEST_S = 0.05
"""A gap of this length may hide a reversal; a lost sample or two may not."""


@dataclass(frozen=True)
class Gap:
    """One step of a clock that is longer than a period.

    Attributes:
        at_s: Where it begins, as the run's clock has it.
        length_s: How long it is.
        jump: Whether it is long, and no sample at its ends is flagged.
    """

    at_s: float
    length_s: float
    jump: bool


def gaps(recording: Recording) -> list[Gap]:
    """Return the gaps of a run's clock, in order."""
    steps = np.diff(recording.time_s)
    if steps.size == 0:
        return []
    usual = float(np.median(steps))
    flagged = recording.flags != 0
    jumps = ~(flagged[:-1] | flagged[1:]) & (steps > usual + LONGEST_S)
    return [
        Gap(float(recording.time_s[k]), float(steps[k]), bool(jumps[k]))
        for k in np.flatnonzero(steps > SKIP * usual)
    ]


def steady(recordings: Sequence[Recording]) -> tuple[list[Recording], list[str]]:
    """Return the runs whose clock does not jump, and a sentence on each other run."""
    kept, lost = [], []
    for recording in recordings:
        jumps = [gap for gap in gaps(recording) if gap.jump]
        if not jumps:
            kept.append(recording)
            continue
        first = jumps[0]
        more = "" if len(jumps) == 1 else f", and at {len(jumps) - 1} more places"
        lost.append(
            f"Run {recording.name} is left out: its clock jumps by {first.length_s:.3g} s at"
            f" {first.at_s:.3f} s{more}, and the motion meanwhile is not known."
        )
    return kept, lost


def skips(recordings: Sequence[Recording]) -> list[str]:
    """Return the limits that the gaps of used runs set, one sentence a run."""
    said = []
    for recording in recordings:
        found = gaps(recording)
        if found:
            longest = max(found, key=lambda gap: gap.length_s)
            said.append(
                f"The clock of run {recording.name} skips {len(found)} times, the longest by"
                f" {longest.length_s:.3g} s at {longest.at_s - recording.time_s[0]:.3g} s:"
                " an effect of time or history is not decided across it."
            )
    return said


def audit(recordings: Sequence[Recording]) -> list[str]:
    """Return the limits of the recordings, one sentence each."""
    return [*skips(recordings), *_excitation(recordings)]


def _excitation(recordings: Sequence[Recording]) -> list[str]:
    said = []
    shared = shared_columns(recordings)
    for name in shared:
        spans = [float(np.ptp(r[name])) for r in recordings]
        if not np.isfinite(spans).all():
            continue
        size = max(float(np.max(np.abs(r[name]))) for r in recordings)
        if max(spans) <= STEADY * size:
            levels = {round(float(np.mean(r[name])) / max(size, 1e-300), 3) for r in recordings}
            held = "never varies" if len(levels) == 1 else "is held within each run"
            said.append(f"{name} {held}: an effect that depends on it is not decided within a run.")
    return said
