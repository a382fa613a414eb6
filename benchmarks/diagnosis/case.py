"""One case: recordings whose hidden effect is known, and how an answer about them is judged."""

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
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

MACHINE_FILE = "machine.toml"
"""In the folder of a case: the machine of the recordings, where it is not the reference rig."""

BLOCK = 1000
"""Seeds of a measurement, which is named by the first of them; `benchmarks.rigs.seeds` states which
are for what. Of the calibrating seeds those below a thousand were also looked at while the first
rules were written. Who has seen an answer about a case of a judging seed must not judge a version
that was changed afterwards with it."""

SURE = 0.9
"""Confidence from which a wrong statement counts as sure and wrong."""


def in_turn(
    kinds: Iterable[str], counts: Mapping[str, int], make: Callable[[str, int], "Case"]
) -> Iterator["Case"]:
    """Yield the cases of each kind by number, the kinds in turn: half of them shows every kind."""
    of_kind = [[(kind, k) for k in range(counts.get(kind, 0))] for kind in kinds]
    for turn in itertools.zip_longest(*of_kind):
        yield from (make(*each) for each in turn if each is not None)


def write_recordings(folder: Path, recordings: Iterable[Recording]) -> None:
    """Write recordings into a folder, which is made, one log a run."""
    folder.mkdir(parents=True, exist_ok=True)
    for recording in recordings:
        write_recording(folder / f"{recording.name}.mcap", recording)


@dataclass(frozen=True)
class Judgement:
    """What an answer is worth.

    Attributes:
        right: Whether the answer is what the case asks for; None where nobody knows the answer.
        sure_and_wrong: Whether a wrong statement was made with a confidence of `SURE` or more.
        extra: Wrong names in addition to the hidden effects.
        equations: Equations in which a hidden effect was named rightly.
        note: What the answer came to, in words.
    """

    right: bool | None
    sure_and_wrong: bool = False
    extra: int = 0
    equations: tuple[str, ...] = ()
    note: str = ""


@dataclass(frozen=True)
class Case:
    """Recordings with a known answer. A generator is anything that yields these.

    Attributes:
        name: Unique in its generator; names the file of the answer.
        kind: One of `KINDS`, or `MACHINE`.
        write: Writes the recordings into an empty folder.
        judge: Judges an answer; it may raise KeyError for an answer that breaks the contract.
        write_without: Writes the same campaign without the hidden effects (same rig, same noise),
            or None where nothing simulates it. The residual of the declared model there is the
            denominator of the error ratio.
        write_next: Plays a proposed protocol (first path, a file) on the same rig and writes the
            new runs into the folder of the old ones (second path); None where nothing can.
        judge_next: Judges the answer about old and new runs together.
        options: Further words of the command line, such as a model; `{case}` is the folder.
    """

    name: str
    kind: str
    write: Callable[[Path], None]
    judge: Callable[[Report], Judgement]
    write_without: Callable[[Path], None] | None = None
    write_next: Callable[[Path, Path], None] | None = None
    judge_next: Callable[[Report], Judgement] | None = None
    options: Sequence[str] = ()
