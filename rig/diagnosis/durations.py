"""How long the stages of earlier diagnoses took on this computer, for the time that is left.

A line of JSON for each diagnosis: its kind (equations and format of the recordings), their bytes
and the seconds of each stage. Times of one kind are taken to grow with the bytes.
"""

import json
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path

from rig.configuration.folders import state_folder
from rig.diagnosis.subject import Subject
from rig.output.console import stages

Range = tuple[float, float]
"""Shortest and longest time, s."""


@contextmanager
def timed_stages(asked: Subject, quick: bool = False) -> Iterator[Callable[[str], None]]:
    """Yield what is called with each stage of a diagnosis that begins; its times are kept.

    A terminal shows each stage and the time that is left. A quick one proposes no next experiment.
    """
    place, (kind, size) = state_folder() / "durations.jsonl", work_of(asked, quick)
    began: list[tuple[str, float]] = []
    with stages(expected(place, kind, size)) as show:

        def begin(stage: str) -> None:
            began.append((stage, time.monotonic()))
            show(stage)

        yield begin
    seconds: dict[str, float] = {}
    for (stage, at), (_, end) in pairwise([*began, ("", time.monotonic())]):
        seconds[stage] = seconds.get(stage, 0.0) + end - at
    add(place, kind, size, seconds)


def work_of(asked: Subject, quick: bool = False) -> tuple[str, float]:
    """Return the kind of a diagnosis, and the bytes of its recordings."""
    files = [run.source for run in asked.campaign.runs if run.source and run.source.is_file()]
    endings = sorted({path.suffix.lower() for path in files})
    equations = [model.balance for model in asked.models]
    kind = " ".join((*equations, *endings, *(["quick"] if quick else [])))
    return kind, float(sum(path.stat().st_size for path in files))


def expected(place: Path, kind: str, size: float, latest: int = 5) -> dict[str, Range]:
    """Return each stage's time, in order, from the latest diagnoses of a kind in a file.

    They grow with the bytes of the recordings. Empty where none of the kind was measured.
    """
    found: dict[str, list[float]] = {}
    with suppress(OSError, ValueError, KeyError, TypeError):
        lines = place.read_text("utf-8").splitlines()
        known = [line for line in map(json.loads, lines) if line["kind"] == kind]
        for one in known[-latest:]:
            for stage, seconds in one["seconds"].items():
                found.setdefault(stage, []).append(seconds * size / one["size"])
    return {stage: (min(times), max(times)) for stage, times in found.items()}


def add(place: Path, kind: str, size: float, seconds: Mapping[str, float]) -> None:
    """Add the times of a diagnosis; a folder that cannot be written costs no diagnosis."""
    if not size:  # recordings in memory
        return
    with suppress(OSError):
        place.parent.mkdir(parents=True, exist_ok=True)
        with place.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"kind": kind, "size": size, "seconds": seconds}) + "\n")
