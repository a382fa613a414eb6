"""A campaign: many runs of one rig, walked run by run, split by run.

A campaign contains run *handles*. A handle has the run's name and conditions and loads the
recording on request, so a campaign may be larger than memory: iterate over it and keep only what
you need. `held` keeps a small one in memory, for what walks it many times.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation.derived import CAMPAIGN_TIME
from estimation.errors import EstimationError
from estimation.recording import Recording

SHOWN = 4
"""Runs that the text of a campaign names."""

MOST_HELD = 40_000_000
"""Values that are kept in memory: 320 MB."""


class CampaignError(EstimationError):
    """Runs do not make a campaign, or a split of it is not possible."""


@dataclass(frozen=True, eq=False)
class Run:
    """A handle on one run: what is known without reading its samples, and how to read them.

    Attributes:
        load: Reads the recording. Called again each time; nothing is cached.
        source: File the run is read from, or None for a run in memory.
        excluded: Reason for excluding the run, or None.
    """

    name: str
    load: Callable[[], Recording]
    source: Path | None = None
    excluded: str | None = None

    def __repr__(self) -> str:
        return f"Run({self.name!r}{', excluded' if self.excluded else ''})"

    def recording(self) -> Recording:
        """Read the recording; the handle's reason of exclusion goes with it."""
        recording = self.load()
        return recording.exclude(self.excluded) if self.excluded else recording


@dataclass(frozen=True)
class Split:
    """Two disjoint sets of runs: one to fit on, one to report on."""

    train: "Campaign"
    test: "Campaign"


@dataclass(frozen=True, eq=False)
class Campaign:
    """Runs in the order they were taken."""

    runs: tuple[Run, ...]

    def __post_init__(self) -> None:
        names = [run.name for run in self.runs]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise CampaignError(
                f"Two runs of the campaign share a name: {', '.join(twice)}.",
                "A run is the unit of evidence and is identified by its name.",
                "Give each run a name of its own, or omit one of its files.",
            )

    @classmethod
    def of(cls, recordings: Iterable[Recording]) -> "Campaign":
        """Make a campaign of recordings held in memory."""
        return cls(tuple(Run(r.name, partial(_itself, r), excluded=r.excluded) for r in recordings))

    def __repr__(self) -> str:
        names = ", ".join(self.names if len(self) <= SHOWN else (*self.names[:SHOWN], "..."))
        return f"Campaign of {len(self)} runs: {names}"

    def __len__(self) -> int:
        return len(self.runs)

    def __iter__(self) -> Iterator[Recording]:
        """Walk the campaign run by run, excluded runs too; one recording is held at a time."""
        return (run.recording() for run in self.runs)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the runs, in order."""
        return tuple(run.name for run in self.runs)

    @property
    def evidence(self) -> "Campaign":
        """The runs that are not excluded."""
        return Campaign(tuple(run for run in self.runs if run.excluded is None))

    def held(self) -> "Campaign":
        """Return the campaign with its recordings in memory, as many as there is room for."""
        left, runs = MOST_HELD, []
        for run in self.runs:
            if run.excluded is None and left > 0:
                recording = run.load()
                left -= len(recording) * (1 + len(recording.columns))
                run = replace(run, load=partial(_itself, recording))
            runs.append(run)
        return Campaign(tuple(runs))

    def exclude(self, reasons: Mapping[str, str]) -> "Campaign":
        """Return a campaign in which some runs are excluded, each with its reason.

        Raises:
            CampaignError: The campaign has no such run.
        """
        for name in reasons.keys() - set(self.names):
            raise CampaignError(
                f"The campaign has no run {name!r}.",
                f"It has: {', '.join(self.names)}.",
                "Name one of these.",
            )
        return Campaign(
            tuple(replace(r, excluded=reasons.get(r.name, r.excluded)) for r in self.runs)
        )

    def select(self, names: Iterable[str]) -> "Campaign":
        """Return the campaign of the named runs, in this campaign's order."""
        wanted = set(names)
        return Campaign(tuple(run for run in self.runs if run.name in wanted))

    def timed(self) -> "Campaign":
        """Return the campaign with the channel `campaign_time_s`, if every run's start is known.

        Walks the campaign once. A run that has the channel keeps it.
        """
        starts = [recording.started_at_ns for recording in self]
        known = [start for start in starts if start is not None]
        if not known or len(known) < len(starts):
            return self
        return Campaign(
            tuple(replace(r, load=partial(_timed, r.load, min(known))) for r in self.runs)
        )

    def folds(self, count: int, seed: int = 0) -> list[Split]:
        """Split by run, shuffled by the seed, into folds: each run is tested exactly once.

        Raises:
            CampaignError: More folds than runs that are not excluded, or fewer than two.
        """
        evidence = self.evidence
        if not 2 <= count <= len(evidence):
            raise CampaignError(
                f"{len(evidence)} runs cannot be split into {count} folds.",
                "Each fold needs at least one run to test and one to fit.",
            )
        tested = [
            {evidence.names[k] for k in fold} for fold in in_folds(len(evidence), count, seed)
        ]
        return [
            Split(evidence.select(set(evidence.names) - names), evidence.select(names))
            for names in tested
        ]


def _itself(recording: Recording) -> Recording:
    return recording


def in_folds(runs: int, count: int, seed: int = 0) -> list[NDArray[np.int_]]:
    """Return the places of the runs of each fold, in an order drawn by a seed."""
    order = np.random.default_rng(seed).permutation(runs)
    return [order[k::count] for k in range(count)]


def with_campaign_time(recording: Recording, began_ns: int) -> Recording:
    """Return a run with the channel `campaign_time_s`, if its start is known and it has none yet.

    The campaign began at `began_ns`, ns since the Unix epoch.
    """
    if recording.started_at_ns is None or CAMPAIGN_TIME in recording:
        return recording
    start_s = (recording.started_at_ns - began_ns) * 1e-9
    since = start_s + recording.time_s - recording.time_s[0]
    return recording.with_columns(**{CAMPAIGN_TIME: since})


def _timed(load: Callable[[], Recording], began_ns: int) -> Recording:
    return with_campaign_time(load(), began_ns)
