"""The noise floor of each balance: what differs between runs that were asked for twice.

Two runs of one motion and load hold the same physics, and so do two periods of one path; half of
the variance of the difference of their residuals is what no model of these variables can explain.
"""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from estimation.diagnosis.design import Run
from estimation.diagnosis.frozen import Frozen
from estimation.diagnosis.paths import path_of
from estimation.diagnosis.story import Story
from estimation.recording import FloatArray, Recording

ASKED = ("target_angle_rad", "load_command_a")
SAME = 2e-3
"""References differ by less than this, rad and A, when they are the same."""

LEAST = 200
"""Samples that two repeats must share."""


def repeats(recordings: Sequence[Recording]) -> list[tuple[str, str]]:
    """Return the pairs of runs of the same motion under the same load."""
    return [
        (one.name, other.name)
        for one, other in itertools.combinations(recordings, 2)
        if len(one) == len(other) and (_of_one_path(one, other) or _asked_alike(one, other))
    ]


def _of_one_path(one: Recording, other: Recording) -> bool:
    return one.name != path_of(one.name) == path_of(other.name)


def _asked_alike(one: Recording, other: Recording) -> bool:
    return (
        all(name in one and name in other for name in ASKED)
        and all(float(np.abs(one[name] - other[name]).max()) < SAME for name in ASKED)
        and float(np.ptp(one[ASKED[0]])) > SAME
    )


def noise_floors(
    stories: Mapping[str, Story], recordings: Sequence[Recording]
) -> dict[str, float | None]:
    """Return each balance's noise floor in its target's unit, None where nothing was repeated.

    Args:
        stories: Balance to its story, the confirm runs opened.
        recordings: The runs.
    """
    pairs = repeats(recordings)
    return {name: _floor(story, pairs) for name, story in stories.items()}


def _floor(story: Story, pairs: Sequence[tuple[str, str]]) -> float | None:
    runs = {run.name: run for run in (*story.balance.runs, *story.confirm)}
    squares, samples = 0.0, 0
    for one, other in pairs:
        if one not in runs or other not in runs:
            continue
        difference = _difference(story.after, runs[one], runs[other])
        if difference.size >= LEAST:
            squares += 0.5 * float(np.sum((difference - difference.mean()) ** 2))
            samples += difference.size
    return float(np.sqrt(squares / samples)) if samples else None


def _difference(model: Frozen, one: Run, other: Run) -> FloatArray:
    """Return the difference of two residuals at the samples that both use."""
    both = one.used & other.used
    return model.error(one)[both[one.used]] - model.error(other)[both[other.used]]
