"""Runs at another zero than the others: a gear or cable slipped, or somebody set the zero again.

An importer states the zero between two encoders of a run as a condition (`motor_zero_offset_rad`).
Of one instrument it scatters from run to run by backlash and stretch. Where the part that joins the
encoders slips, what the torques do changes with the zero.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from estimation.recording import Recording

ZERO = "_zero_offset_"
"""Part of the names of conditions that are zeros."""

LEAST_USUAL = 6
"""Runs at the usual zero from which their scatter is known."""


@dataclass(frozen=True)
class MovedZero:
    """Runs of one instrument whose zero is farther from the others than these scatter."""

    condition: str  # name of the zero
    runs: tuple[str, ...]
    lowest: float  # lowest zero of these runs, in the unit of the condition
    highest: float  # highest zero of these runs
    usual: tuple[float, float]  # lowest and highest zero of the others

    @property
    def sentence(self) -> str:
        """What happened, for a person."""
        have = f"have their zero at {self.lowest:.3g} to {self.highest:.3g}"
        if len(self.runs) == 1:
            have = f"has its zero at {self.lowest:.3g}"
        return (
            f"{self.condition}: {', '.join(self.runs)} {have}, all others at {self.usual[0]:.3g} to"
            f" {self.usual[1]:.3g}; did a gear, a coupling or a cable slip, or was the zero set"
            " again?"
        )


def moved_zeros(recordings: Iterable[Recording]) -> list[MovedZero]:
    """Return the runs whose zero is apart, of each instrument and each zero.

    The zeros are cut in two where they are farthest apart. The smaller part is apart where the gap
    is wider than the scatter of the larger one.
    """
    zeros: dict[tuple[object, str], list[tuple[float, str]]] = {}
    for recording in recordings:
        for name, value in recording.conditions.items():
            if ZERO in name and isinstance(value, float) and np.isfinite(value):
                zeros.setdefault((recording.instrument, name), []).append((value, recording.name))
    return [one for (_, name), known in zeros.items() for one in _apart(name, known)]


def _apart(condition: str, known: list[tuple[float, str]]) -> Iterator[MovedZero]:
    ordered = sorted(known)
    gaps = np.diff([value for value, _ in ordered])
    if not len(gaps):
        return
    cut = int(np.argmax(gaps)) + 1
    moved, usual = sorted((ordered[:cut], ordered[cut:]), key=len)
    if len(usual) < LEAST_USUAL or len(usual) == len(moved):
        return
    low, high = usual[0][0], usual[-1][0]
    if gaps[cut - 1] > high - low:
        names = tuple(sorted(name for _, name in moved))
        yield MovedZero(condition, names, moved[0][0], moved[-1][0], (low, high))
