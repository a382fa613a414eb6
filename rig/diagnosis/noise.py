"""The noise floor of each equation: the difference between runs that repeat one another.

Two runs of one motion and load contain the same physics, and so do two periods of one path. Half of
the variance of the difference of their residuals is unexplained by any model of these variables.
"""

import itertools
from collections.abc import Sequence

import numpy as np

from estimation.causes.refits import Refits
from estimation.diagnosis.paths import path_of
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


def noise_floors(refits: Refits, recordings: Sequence[Recording]) -> dict[str, float | None]:
    """Return each equation's noise floor in its target's unit, None where nothing was repeated.

    Args:
        refits: The equations with the causes found.
        recordings: The runs.
    """
    pairs = repeats(recordings)
    return {name: _floor(refits, name, pairs) for name in refits.of}


def _floor(refits: Refits, equation: str, pairs: Sequence[tuple[str, str]]) -> float | None:
    squares, samples = 0.0, 0
    for one, other in pairs:
        difference = _difference(refits, equation, one, other)
        if difference.size >= LEAST:
            squares += 0.5 * float(np.sum((difference - difference.mean()) ** 2))
            samples += difference.size
    return float(np.sqrt(squares / samples)) if samples else None


def _difference(refits: Refits, equation: str, one: str, other: str) -> FloatArray:
    """Return the difference of two residuals at the samples that both use."""
    solved = refits.after(equation)
    found = [refits.of[equation].residuals(solved, name) for name in (one, other)]
    if found[0] is None or found[1] is None:
        return np.empty(0)
    (first, left), (second, right) = found[0], found[1]
    _, at, also = np.intersect1d(first, second, assume_unique=True, return_indices=True)
    return np.asarray(left[at] - right[also])
