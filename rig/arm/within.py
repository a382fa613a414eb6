"""Effects of an arm chosen on one path alone, so that another path is untouched by the choice.

The path is cut into segments, at the same places of every period. Periods repeat, so a random
split would leak. Every other segment is fitted and the rest is the test, and back.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimation.arm.effects import ArmEffect
from estimation.arm.motion import LOW_PASS
from estimation.diagnosis.split import SplitError, period_samples
from estimation.recording import Recording
from rig.arm.search import RATE_SHARE, Prepared, search

STRETCHES = 8
"""Of a period: each is longer than the filter's memory, and half of them cover most of the
range."""


def period_of(run: Recording) -> float | None:
    """Return the period of a run's motion in samples of a prepared path; None if it has none."""
    try:
        seconds = period_samples(run) / run.sample_rate_hz
    except SplitError:
        return None
    return seconds * RATE_SHARE * LOW_PASS.cutoff_hz


def chosen_within(path: Prepared, run: Recording, tried: Sequence[ArmEffect]) -> list[str]:
    """Return the effects that help from some stretches of a path to the others and back.

    Args:
        path: The path, prepared with these effects.
        run: The original run.
        tried: The candidates.
    """
    samples = np.arange(len(path.torque))
    period = period_of(run) or len(samples)
    first = np.floor(samples / period * STRETCHES) % 2 == 0
    arrays = ("torque", "thesis", "closed", "table")
    one, other = (
        replace(path, **{name: getattr(path, name)[kept] for name in arrays})
        for kept in (first, ~first)
    )
    return search((one, other), (other, one), tried)[1]
