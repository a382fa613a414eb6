"""Splitting runs once into training runs and held-out test runs, before anything is fitted.

The test runs are chosen by a seed, stratified over the conditions: runs are sorted by what was held
constant and one run of every stratum of neighbours becomes a test run, but not the last one of the
least or greatest load, speed or other condition. Where a level of another condition is then missing
among the training or the test runs, runs are exchanged, see `estimation.diagnosis.balanced`. Runs
whose conditions nobody stated are sorted by how much their channels vary.

Of few recordings, pieces stand for runs. Of two paths that repeat themselves, the periods of one
train and those of the other test. Other recordings of too small a number are cut into equal parts.
"""

import hashlib
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation.causes.numbers import DEFAULT
from estimation.diagnosis.balanced import Levels, shared
from estimation.errors import EstimationError
from estimation.recording import FloatArray, Recording, shared_columns

PERIOD, PART = ", period ", ", part "

PARTS, SHORTEST_PART_S = 10, 2.0
"""Parts that few recordings are cut into, and the shortest."""

REPEATS, SHORTEST_PERIOD_S, ALIKE = 3, 1.0, 0.7
"""Periods that a path must have, the shortest, and the least correlation with the next one."""


class SplitError(EstimationError):
    """The runs do not make a campaign that can be split."""


@dataclass(frozen=True, slots=True)
class Sealed:
    """The split, written down before the first fit.

    Attributes:
        discover: Names of the training runs.
        confirm: Names of the test runs, opened once, at the end.
        seed: Seed of the choice.
        data_hash: SHA-256 of every run's name and samples; the access log's key.
        seal: SHA-256 of the data's hash and both lists.
    """

    discover: tuple[str, ...]
    confirm: tuple[str, ...]
    seed: int
    data_hash: str
    seal: str

    @property
    def may_name(self) -> bool:
        """Whether there are enough training runs to name an effect."""
        return len(self.discover) >= DEFAULT.least_to_name

    def without(self, names: Collection[str]) -> "Sealed":
        """Return the split without runs that cannot be used; the seal is of all.

        Raises:
            SplitError: No training run or no test run is left.
        """
        kept = replace(
            self,
            discover=tuple(n for n in self.discover if n not in names),
            confirm=tuple(n for n in self.confirm if n not in names),
        )
        if not kept.discover or not kept.confirm:
            raise SplitError(
                f"{len(names)} runs are too short for the equations.",
                "No training run or no test run is left.",
                "Record longer runs, or more of them.",
            )
        return kept


def split(recordings: Sequence[Recording], seed: int = 0, seen: Collection[str] = ()) -> Sealed:
    """Choose the test runs, stratified over the conditions.

    The training runs keep the least and the greatest value of every condition: a model is not
    judged beyond its conditions. Where there are enough new runs besides those that an earlier
    diagnosis has seen, only new ones become test runs: a run confirms once. The seed chooses inside
    each stratum. Each part has runs of every level of which there are enough.

    Raises:
        SplitError: Fewer than three runs, or runs of different rigs or instruments.
    """
    _check_one_rig(recordings)
    share = DEFAULT.runs_a_test_run
    if len(recordings) < share:
        raise SplitError(
            f"{len(recordings)} runs are too few to diagnose.",
            "Some runs must find an effect, and others, held out, confirm it.",
            f"Record {share} runs at least; to name an effect, seven.",
        )
    new = [recording for recording in recordings if recording.name not in seen]
    levels = _levels(recordings)
    ordered = sorted(
        new if len(new) >= share else recordings, key=lambda r: _place(r.name, levels[r.name])
    )
    random = np.random.default_rng(seed)
    confirm: set[str] = set()
    for start in range(0, len(ordered) - share + 1, share):
        stratum = [ordered[start + int(k)].name for k in random.permutation(share)]
        inside = (n for n in stratum if _spans_all(levels, {*confirm, n}))
        confirm.add(next(inside, stratum[0]))
    confirm = shared(
        {recording.name: levels[recording.name] for recording in ordered},
        confirm,
        share,
        lambda held: _spans_all(levels, held) or not _spans_all(levels, confirm),
    )
    return _sealed(recordings, [recording.name for recording in recordings], confirm, seed)


def cut_and_split(
    recordings: Sequence[Recording], seed: int = 0, seen: Collection[str] = ()
) -> tuple[list[Recording], Sealed]:
    """Return the runs and their split; few recordings are cut into pieces that stand for runs.

    Of two paths the one tests that no earlier diagnosis has seen.

    Raises:
        SplitError: The recordings are of different rigs or instruments; or one of two does not
            repeat itself; or they are too few, and too short to be cut.
    """
    number = len(recordings)
    if number == 2:
        return _split_paths(recordings, seed, seen)
    each = math.ceil(PARTS / max(1, number))
    longest = min((float(np.ptp(r.time_s)) for r in recordings), default=0.0)
    enough = number - number // DEFAULT.runs_a_test_run >= DEFAULT.least_to_name
    if enough or longest < each * SHORTEST_PART_S:
        return [*recordings], split(recordings, seed, seen)
    _check_one_rig(recordings)
    pieces = [
        piece
        for recording in recordings
        for piece in _pieces(recording, np.array_split(np.arange(len(recording)), each), PART)
    ]
    known = {piece.name for piece in pieces if path_of(piece.name) in seen}
    return pieces, split(pieces, seed, known)


def _split_paths(
    paths: Sequence[Recording], seed: int, seen: Collection[str]
) -> tuple[list[Recording], Sealed]:
    """Cut two paths into whole periods and choose which path tests."""
    _check_one_rig(paths)
    new = [k for k, path in enumerate(paths) if path.name not in seen]
    tests = new[0] if len(new) == 1 else int(np.random.default_rng(seed).integers(len(paths)))
    pieces = [piece for path in paths for piece in periods(path)]
    names = [piece.name for piece in pieces]
    held = {name for name in names if path_of(name) == paths[tests].name}
    return pieces, _sealed(paths, names, held, seed)


def path_of(name: str) -> str:
    """Return the name of the recording a piece was cut from; of a run its own name."""
    return period_of(name) or name.rpartition(PART)[0] or name


def period_of(name: str) -> str:
    """Return the name of the path that a piece is a period of; empty of no period."""
    return name.rpartition(PERIOD)[0]


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
    return _pieces(path, (np.arange(k, min(k + length, len(path))) for k in starts), PERIOD)


def period_samples(path: Recording) -> int:
    """Return the length of a path's period: where its positions are most like themselves.

    Raises:
        SplitError: It does not repeat itself often enough.
    """
    angles = [
        values
        for name, values in path.columns.items()
        if ("angle" in name or "position" in name) and np.ptp(values) > 0
    ]
    shortest, longest = round(SHORTEST_PERIOD_S * path.sample_rate_hz), len(path) // REPEATS
    likeness = np.mean([_likeness(x)[: longest + 1] for x in angles] or [np.zeros(1)], axis=0)
    # what is near lag zero is alike because nothing has moved yet
    apart = int(np.argmax(likeness < 0.5)) if (likeness < 0.5).any() else len(likeness)
    likeness[: max(apart, shortest)] = -1.0
    # two periods are as alike as one: the shortest lag about as good as the best
    near = np.flatnonzero(likeness >= likeness.max() - 0.02)
    first = np.split(near, np.flatnonzero(np.diff(near) > 1) + 1)[0]
    best = int(first[np.argmax(likeness[first])])
    if likeness[best] < ALIKE:
        raise SplitError(
            f"Path {path.name!r} does not repeat itself {REPEATS} times.",
            "With two recordings only, whole periods of one stand for runs, and there are none.",
            "Record three runs at least, or paths of several periods.",
        )
    return best


def _likeness(x: FloatArray) -> FloatArray:
    """Return the correlation of a signal with itself at every lag, shape (n,)."""
    n = len(x)
    centred = x - x.mean()
    sums = np.fft.irfft(np.abs(np.fft.rfft(centred, 2 * n)) ** 2)[:n]
    whole = np.concatenate([[0.0], np.cumsum(centred**2)])
    lags = np.arange(n)
    early, late = whole[n - lags], whole[n] - whole[lags]
    return np.asarray(sums / np.maximum(np.sqrt(early * late), np.finfo(float).tiny))


def _pieces(path: Recording, places: Iterable[NDArray[np.intp]], mark: str) -> list[Recording]:
    return [
        replace(path.at(part), name=f"{path.name}{mark}{number}")
        for number, part in enumerate(places, start=1)
    ]


def _levels(recordings: Sequence[Recording]) -> dict[str, Levels]:
    """Return each run's conditions; where these are alike, how much its channels vary."""
    stated = {r.name: r.conditions for r in recordings}
    first = recordings[0].conditions
    if any(conditions != first for conditions in stated.values()):
        return stated
    # three speeds in turn, say: neighbours by name would have one speed in every test run
    return {
        name: {"variation": float(level)}
        for name, level in zip(stated, _variations(recordings), strict=True)
    }


def _variations(recordings: Sequence[Recording]) -> FloatArray:
    """Return the first principal component of the logarithms of the channels' variations."""
    shared = shared_columns(recordings)
    spreads = np.array([[np.nanstd(r[name]) for name in shared] for r in recordings])
    logs = np.log(spreads[:, (spreads > 0.0).all(axis=0)])
    if not logs.size:
        return np.zeros(len(recordings))
    logs -= logs.mean(axis=0)
    axis = np.linalg.svd(logs, full_matrices=False)[2][0]
    return np.asarray(logs @ axis * np.sign(axis.sum() or 1.0))


def _place(name: str, levels: Levels) -> tuple[tuple[str, int, float, str], ...]:
    """Return where a run sorts among the others: by its conditions, then by its name."""
    keys: list[tuple[str, int, float, str]] = []
    for key, value in sorted(levels.items()):
        numeric = isinstance(value, int | float)
        keys.append((key, int(not numeric), float(value) if numeric else 0.0, str(value)))
    return (*keys, ("~name", 0, 0.0, name))


def _spans_all(levels: Mapping[str, Levels], held: Collection[str]) -> bool:
    """Whether the runs that are not held have the range of every condition that all have."""
    kept = [own for name, own in levels.items() if name not in held]
    return _ranges(kept) == _ranges(levels.values())


def _ranges(levels: Iterable[Levels]) -> dict[str, tuple[float, float]]:
    found: dict[str, list[float]] = {}
    for own in levels:
        for name, value in own.items():
            if isinstance(value, int | float):
                found.setdefault(name, []).append(float(value))
    return {name: (min(values), max(values)) for name, values in found.items()}


def _sealed(
    recordings: Sequence[Recording], names: Sequence[str], held: Collection[str], seed: int
) -> Sealed:
    """Return the split of runs, or of pieces of recordings, by the names of those held out."""
    discover = tuple(n for n in names if n not in held)
    confirm = tuple(n for n in names if n in held)
    data = data_hash(recordings)
    return Sealed(discover, confirm, seed, data, _hash(data, *discover, "|", *confirm))


def data_hash(recordings: Sequence[Recording]) -> str:
    """Return SHA-256 over the runs' names and samples, in the order of their names."""
    ordered = sorted(recordings, key=lambda r: r.name)
    return _hash(*(part for r in ordered for part in (r.name, samples_hash(r))))


def samples_hash(recording: Recording, of_clock: bool = True) -> str:
    """Return SHA-256 over one run's samples, and its clock, whatever the run is called."""
    digest = hashlib.sha256(recording.time_s.tobytes() if of_clock else b"")
    digest.update(recording.flags.tobytes())
    for name in sorted(recording.columns):
        digest.update(name.encode())
        digest.update(recording.columns[name].tobytes())
    return digest.hexdigest()


def _hash(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def _check_one_rig(recordings: Sequence[Recording]) -> None:
    for what, found in (
        ("rigs", {r.rig for r in recordings}),
        ("instruments", {f"{r.instrument.model} {r.instrument.serial}" for r in recordings}),
    ):
        if len(found) > 1:
            raise SplitError(
                f"The runs are of {len(found)} {what}: {', '.join(sorted(found))}.",
                f"What differs between {what} would be taken for an effect; nothing is decided.",
                "Diagnose each of them by itself.",
            )
