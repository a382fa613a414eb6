"""Splitting runs once into training runs and held-out test runs.

The test runs are chosen before anything is fitted, by a seed, stratified over the conditions: runs
are sorted by what was held constant and one run of every stratum of neighbours becomes a test run,
but not the last one of the least or greatest load, speed or other condition.
"""

import hashlib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.campaign import Campaign
from estimation.errors import EstimationError
from estimation.recording import Recording

SHARE = 3
"""One run in this many is a test run."""

LEAST_TO_NAME = 5
"""With fewer training runs no effect is named: a sign test over four runs cannot reach 5 %."""


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
        return len(self.discover) >= LEAST_TO_NAME

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
    judged beyond its conditions.

    Where there are enough new runs besides those of earlier diagnoses, only new ones become test
    runs: a run confirms once.

    Args:
        recordings: Runs that count as evidence, three at least.
        seed: Seed of the choice inside each stratum.
        seen: Names of runs that an earlier diagnosis held.

    Raises:
        SplitError: Fewer than three runs, or runs of different rigs or instruments.
    """
    check_one_rig(recordings)
    if len(recordings) < SHARE:
        raise SplitError(
            f"{len(recordings)} runs are too few to diagnose.",
            "Some runs must find an effect, and others, held out, confirm it.",
            f"Record {SHARE} runs at least; to name an effect, eight.",
        )
    new = [recording for recording in recordings if recording.name not in seen]
    ordered = sorted(new if len(new) >= SHARE else recordings, key=_place)
    random = np.random.default_rng(seed)
    confirm: set[str] = set()
    for start in range(0, len(ordered) - SHARE + 1, SHARE):
        stratum = [ordered[start + int(k)].name for k in random.permutation(SHARE)]
        inside = (n for n in stratum if _spans_all(recordings, {*confirm, n}))
        confirm.add(next(inside, stratum[0]))
    names = [recording.name for recording in recordings]
    data = data_hash(recordings)
    kept = tuple(n for n in names if n not in confirm)
    held = tuple(n for n in names if n in confirm)
    return Sealed(kept, held, seed, data, seal(data, kept, held))


def _spans_all(recordings: Sequence[Recording], held: Collection[str]) -> bool:
    """Whether the runs that are not held have the range of every condition that all have."""
    return _ranges([r for r in recordings if r.name not in held]) == _ranges(recordings)


def _ranges(recordings: Sequence[Recording]) -> dict[str, tuple[float, float]]:
    found: dict[str, list[float]] = {}
    for recording in recordings:
        for name, value in recording.conditions.items():
            if isinstance(value, int | float):
                found.setdefault(name, []).append(float(value))
    return {name: (min(values), max(values)) for name, values in found.items()}


def seal(data: str, discover: Sequence[str], confirm: Sequence[str]) -> str:
    """Return SHA-256 over the data's hash and both lists."""
    return _hash(data, *discover, "|", *confirm)


def data_hash(recordings: Sequence[Recording]) -> str:
    """Return SHA-256 over the runs' names and samples, in the order of their names."""
    ordered = sorted(recordings, key=lambda r: r.name)
    return _hash(*(part for r in ordered for part in (r.name, samples_hash(r))))


def samples_hash(recording: Recording) -> str:
    """Return SHA-256 over one run's samples, whatever the run is called."""
    digest = hashlib.sha256(recording.time_s.tobytes())
    digest.update(recording.flags.tobytes())
    for name in sorted(recording.columns):
        digest.update(name.encode())
        digest.update(recording.columns[name].tobytes())
    return digest.hexdigest()


def evidence(campaign: Campaign) -> list[Recording]:
    """Read the runs that are not excluded into memory."""
    return list(campaign.evidence)


def _hash(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def _place(recording: Recording) -> tuple[tuple[str, int, float, str], ...]:
    """Return where a run sorts among the others: by its conditions, then by its name."""
    keys: list[tuple[str, int, float, str]] = []
    for name, value in sorted(recording.conditions.items()):
        numeric = isinstance(value, int | float)
        keys.append((name, int(not numeric), float(value) if numeric else 0.0, str(value)))
    return (*keys, ("~name", 0, 0.0, recording.name))


def check_one_rig(recordings: Sequence[Recording]) -> None:
    """Raise when the runs come from different rigs or instruments."""
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
