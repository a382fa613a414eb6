"""One case: recordings whose hidden effect is known, and how an answer about them is judged."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from estimation.recording import Recording
from rig.log.convert import write_recording

Report = Mapping[str, Any]
"""The JSON answer of `rig diagnose`."""

KINDS = {
    "strong": "strong",
    "weak": "weak",
    "pair": "pairs",
    "outside": "outside",
    "some_runs": "some runs",
    "confounded": "confounded",
    "clean": "clean",
}
"""Classes of simulated cases, and their headings on the results page."""

MACHINE = "machine"
"""Kind of a case that holds measured data of a machine somebody else built."""

SURE = 0.9
"""Confidence from which a wrong statement counts as sure and wrong."""


def write_recordings(folder: Path, recordings: Iterable[Recording]) -> None:
    """Write recordings into a folder, one log a run."""
    for recording in recordings:
        write_recording(folder / f"{recording.name}.mcap", recording)


@dataclass(frozen=True)
class Judgement:
    """What an answer is worth."""

    # Whether the answer is what the case asks for; None where nobody knows the answer
    right: bool | None
    # Whether a wrong statement was made with a confidence of `SURE` or more
    sure_and_wrong: bool = False
    extra: int = 0  # Wrong names in addition to the hidden effects
    equations: tuple[str, ...] = ()  # Equations in which a hidden effect was named rightly
    note: str = ""  # What the answer came to, in words


@dataclass(frozen=True)
class Case:
    """Recordings with a known answer. A generator is anything that yields these."""

    name: str  # Unique in its generator; names the file of the answer
    kind: str  # One of `KINDS`, or `MACHINE`
    write: Callable[[Path], None]  # Writes the recordings into an empty folder
    # Judges an answer; it may raise KeyError for an answer that breaks the contract
    judge: Callable[[Report], Judgement]
    # Writes the same campaign without the hidden effects (same rig, same noise), or None where
    # nothing simulates it. The residual of the declared model there is the denominator of the error
    # ratio.
    write_without: Callable[[Path], None] | None = None
    # Plays a proposed protocol (first path, a file) on the same rig and writes the new runs into
    # the folder of the old ones (second path); None where nothing can
    write_next: Callable[[Path, Path], None] | None = None
    # Judges the answer about old and new runs together
    judge_next: Callable[[Report], Judgement] | None = None
    # Further words of the command line, such as a model; `{case}` is the folder
    options: Sequence[str] = ()
