"""The audit of the clocks: a run whose clock jumps is no evidence.

Filters take samples as evenly spaced. Across a gap that nobody flagged they join what was apart,
and the joint looks like a fast motion without a torque.
"""

from collections.abc import Sequence

import numpy as np

from estimation.recording import Recording

LONGEST_S = 0.05
"""A gap of this length may hide a reversal; a lost sample or two may not."""


def jump(recording: Recording) -> str:
    """Return where a run's clock jumps, in words; empty when it is steady or the gap is flagged."""
    steps = np.diff(recording.time_s)
    if steps.size == 0:
        return ""
    flagged = recording.flags != 0
    open_ = ~(flagged[:-1] | flagged[1:])
    usual = float(np.median(steps))
    far = np.flatnonzero(open_ & (steps > usual + LONGEST_S))
    if far.size == 0:
        return ""
    first = int(far[0])
    more = "" if far.size == 1 else f", and at {far.size - 1} more places"
    return f"jumps by {steps[first]:.3g} s at {recording.time_s[first]:.3f} s{more}"


def steady(recordings: Sequence[Recording]) -> tuple[list[Recording], list[str]]:
    """Return the runs whose clock is steady, and what was left out and why, in words."""
    jumps = [(recording, jump(recording)) for recording in recordings]
    kept = [recording for recording, found in jumps if not found]
    lost = [
        f"Run {recording.name} is left out: its clock {found}, and what happened meanwhile is not"
        " known."
        for recording, found in jumps
        if found
    ]
    return kept, lost
