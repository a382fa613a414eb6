"""Few recordings: pieces of them stand for runs.

Where a motion was recorded along two paths and no more, no run can be held out. A path that repeats
itself is cut into its periods, which take the place of runs; the other path, cut in the same way,
is opened once. Other recordings of too small a number are cut into equal parts, some of which test.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation.diagnosis.split import (
    LEAST_TO_NAME,
    SHARE,
    Sealed,
    SplitError,
    check_one_rig,
    data_hash,
    seal,
    split,
)
from estimation.recording import FloatArray, Recording

PATHS = 2
LEAST_PERIODS = 3
ALIKE = 0.7
"""Least correlation of a path with itself one period later."""

AS_GOOD = 0.02
SHORTEST_S = 1.0
MARK, PART = ", period ", ", part "
PARTS, SHORTEST_PART_S = 10, 2.0
"""Parts that few recordings are cut into, and the shortest part."""


def split_paths(
    recordings: Sequence[Recording], seed: int = 0, seen: Collection[str] = ()
) -> tuple[list[Recording], Sealed]:
    """Cut two paths into whole periods and choose which path trains.

    Args:
        recordings: The two paths.
        seed: Seed of the choice.
        seen: Names of paths that an earlier diagnosis held; where one is new, that one tests.

    Returns:
        The periods of both paths, and their split.

    Raises:
        SplitError: The paths are of different rigs or instruments, or one does not repeat itself.
    """
    check_one_rig(recordings)
    new = [k for k, path in enumerate(recordings) if path.name not in seen]
    confirms = new[0] if len(new) == 1 else int(np.random.default_rng(seed).integers(PATHS))
    cut = [periods(path) for path in recordings]
    discover = tuple(piece.name for piece in cut[1 - confirms])
    confirm = tuple(piece.name for piece in cut[confirms])
    data = data_hash(recordings)
    sealed = Sealed(discover, confirm, seed, data, seal(data, discover, confirm))
    return [*cut[0], *cut[1]], sealed


def split_few(
    recordings: Sequence[Recording], seed: int = 0, seen: Collection[str] = ()
) -> tuple[list[Recording], Sealed]:
    """Choose the test runs; too few recordings are cut into equal parts, which stand for runs.

    Args:
        recordings: Any number.
        seed: Seed of the choice.
        seen: Names of recordings that an earlier diagnosis held.

    Returns:
        The runs, and their split.

    Raises:
        SplitError: The recordings are too few or of different rigs, and too short to be cut.
    """
    number = len(recordings)
    each = math.ceil(PARTS / max(1, number))
    longest = min((float(np.ptp(r.time_s)) for r in recordings), default=0.0)
    if number - number // SHARE >= LEAST_TO_NAME or longest < each * SHORTEST_PART_S:
        return [*recordings], split(recordings, seed, seen)
    check_one_rig(recordings)
    pieces = [
        _piece(recording, places, k, PART)
        for recording in recordings
        for k, places in enumerate(np.array_split(np.arange(len(recording)), each), start=1)
    ]
    known = {piece.name for piece in pieces if path_of(piece.name) in seen}
    return pieces, split(pieces, seed, known)


def path_of(name: str) -> str:
    """Return the name of the recording a piece was cut from; of a run its own name."""
    return name.rpartition(MARK)[0] or name.rpartition(PART)[0] or name


def claim(sealed: Sealed) -> str | None:
    """Return the limit of the evidence of pieces, in words; None where whole runs were split."""
    names = (*sealed.discover, *sealed.confirm)
    whole = {path_of(name) for name in names}
    if whole == {*names}:
        return None
    if any(PART in name for name in names):
        return (
            f"Only {len(whole)} recording{'s' * (len(whole) > 1)}, cut into {len(names)} parts that"
            f" stand for runs: {len(sealed.discover)} trained and {len(sealed.confirm)} tested."
            " Parts of one recording are less apart than runs."
        )
    return (
        f"Two recorded paths only: {path_of(sealed.discover[0])} trained, cross-validated by its"
        f" {len(sealed.discover)} periods, and {path_of(sealed.confirm[0])} tested."
        " Periods of one path are less apart than runs: the claim holds for these two paths."
    )


def periods(path: Recording) -> list[Recording]:
    """Cut a path into its whole periods; a rest of half a period and more at its end counts too.

    Raises:
        SplitError: It does not repeat itself.
    """
    length = period_samples(path)
    starts = range(0, len(path) - length // 2, length)
    return [
        _piece(path, np.arange(start, min(start + length, len(path))), number, MARK)
        for number, start in enumerate(starts, start=1)
    ]


def period_samples(path: Recording) -> int:
    """Return the length of a path's period: where its positions are most like themselves.

    Raises:
        SplitError: No such length that fits three times into the path.
    """
    angles = [
        values
        for name, values in path.columns.items()
        if ("angle" in name or "position" in name) and np.ptp(values) > 0
    ]
    shortest, longest = round(SHORTEST_S * path.sample_rate_hz), len(path) // LEAST_PERIODS
    likeness = np.mean([_likeness(x)[: longest + 1] for x in angles], axis=0) if angles else [0.0]
    inside = np.array(likeness)
    # what is near lag zero is alike because nothing has moved yet
    apart = int(np.argmax(inside < 0.5)) if (inside < 0.5).any() else len(inside)
    inside[: max(apart, shortest)] = -1.0
    best = _first_peak(inside)
    if inside.size == 0 or inside[best] < ALIKE:
        raise SplitError(
            f"Path {path.name!r} does not repeat itself {LEAST_PERIODS} times.",
            "With two recordings only, whole periods of one stand for runs, and there are none.",
            "Record three runs at least, or paths of several periods.",
        )
    return best


def _first_peak(likeness: FloatArray) -> int:
    """Return the shortest lag about as good as the best: two periods are as alike as one."""
    if likeness.size == 0:
        return 0
    near = np.flatnonzero(likeness >= likeness.max() - AS_GOOD)
    first = np.split(near, np.flatnonzero(np.diff(near) > 1) + 1)[0]
    return int(first[np.argmax(likeness[first])])


def _likeness(x: FloatArray) -> FloatArray:
    """Return the correlation of a signal with itself at every lag, shape (n,)."""
    n = len(x)
    centred = x - x.mean()
    power = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    sums = np.fft.irfft(power)[:n]
    whole = np.concatenate([[0.0], np.cumsum(centred**2)])
    lags = np.arange(n)
    early, late = whole[n - lags], whole[n] - whole[lags]
    likeness: FloatArray = sums / np.maximum(np.sqrt(early * late), np.finfo(float).tiny)
    return likeness


def _piece(path: Recording, places: NDArray[np.intp], number: int, mark: str) -> Recording:
    return replace(path.at(places), name=f"{path.name}{mark}{number}")
