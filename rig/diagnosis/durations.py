"""How long the stages of earlier diagnoses took on this computer, for the time that is left.

A line of JSON for each diagnosis: its kind (equations and format of the recordings), their bytes
and the seconds of each stage. Times of one kind are taken to grow with the bytes.
"""

import json
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from rig.diagnosis.ledger import state_folder
from rig.diagnosis.subject import Subject

LATEST = 5
"""Earlier diagnoses of a kind that count."""

Range = tuple[float, float]
"""Shortest and longest time, s."""


@dataclass(frozen=True)
class Durations:
    """The times so far.

    Attributes:
        path: The file; made at the first use.
    """

    path: Path

    def expected(self, kind: str, size: float) -> dict[str, Range]:
        """Return each stage's time, in order; empty where none of the kind was measured.

        Args:
            kind: Kind of the diagnosis.
            size: Bytes of its recordings.
        """
        found: dict[str, list[float]] = {}
        with suppress(OSError, ValueError, KeyError, TypeError):
            lines = self.path.read_text("utf-8").splitlines()
            known = [line for line in map(json.loads, lines) if line["kind"] == kind]
            for one in known[-LATEST:]:
                for stage, seconds in one["seconds"].items():
                    found.setdefault(stage, []).append(seconds * size / one["size"])
        return {stage: (min(times), max(times)) for stage, times in found.items()}

    def add(self, kind: str, size: float, seconds: Mapping[str, float]) -> None:
        """Add the times of a diagnosis; a folder that cannot be written costs no diagnosis."""
        if not size:  # recordings in memory
            return
        line = json.dumps({"kind": kind, "size": size, "seconds": dict(seconds)})
        with suppress(OSError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a", encoding="utf-8") as file:
                file.write(line + "\n")


def default_durations() -> Durations:
    """Return the file in the folder of the access log."""
    return Durations(state_folder() / "durations.jsonl")


def work_of(asked: Subject, quick: bool = False) -> tuple[str, float]:
    """Return the kind of a diagnosis, and the bytes of its recordings.

    Args:
        asked: What is diagnosed.
        quick: Whether no next experiment is proposed.
    """
    files = [run.source for run in asked.campaign.runs if run.source and run.source.is_file()]
    endings = sorted({path.suffix.lower() for path in files})
    equations = [model.balance for model in asked.models]
    return " ".join((*equations, *endings, *(["quick"] if quick else []))), float(
        sum(path.stat().st_size for path in files)
    )


@contextmanager
def measured(
    on_stage: Callable[[str], None],
) -> Iterator[tuple[Callable[[str], None], dict[str, float]]]:
    """Yield what is called with each stage that begins, and the seconds of those that ended."""
    seconds: dict[str, float] = {}
    began: list[tuple[str, float]] = []

    def end() -> None:
        for stage, start in began:
            seconds[stage] = seconds.get(stage, 0.0) + time.monotonic() - start
        began.clear()

    def begin(what: str) -> None:
        end()
        began.append((what, time.monotonic()))
        on_stage(what)

    yield begin, seconds
    end()
