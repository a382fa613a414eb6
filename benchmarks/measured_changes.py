"""`rig diff` on measured pairs of campaigns: other instruments, dates and loads, and halves of one.

`python -m benchmarks.measured_changes --data FOLDER [--out FILE] [--only WORD]`. A pair takes ten
seconds to two minutes; pairs without data are skipped and named.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from estimation.campaign import Campaign
from estimation.changes.compare import compare
from estimation.changes.difference import Difference
from estimation.errors import EstimationError
from estimation.files import write_text_atomic
from estimation.recording import Recording
from rig.diagnosis.subject import Subject, subject
from rig.machines.shipped import place_of
from rig.output.provenance import Provenance
from rig.output.table import TextTable, to_page
from rig.reports.changes import lines, prediction_table
from rig.studies.machines.study import unpacked

L_4, L_2, RIGHT = (
    f"mrdlab-Tool_{n}.tar.xz" for n in ("4_Maryland_L_4", "4_Maryland_L_2", "5_Maryland_L_2")
)
GRASPER, SERVO = "smart-grasper", "sts3215"
LAP_S = 4.6
"""The grasper's first date has one sweep: all sweeps are cut into five parts."""

Chosen = Callable[[Sequence[Recording]], Sequence[Recording]]


@dataclass(frozen=True)
class Side:
    """One campaign of a pair.

    Attributes:
        place: File in the folder of the data, or folder of a machine of other people.
        chosen: Which of its runs.
    """

    place: str
    chosen: Chosen = list


@dataclass(frozen=True)
class Pair:
    """Two campaigns.

    Attributes:
        name: What differs.
        expected: What is known of it beforehand.
        sides: The two campaigns, and a third one to predict if there is one.
        machine: Shipped machine that its tables are read as.
        more: Lines added under `[data.runs]` of its file.
    """

    name: str
    expected: str
    sides: tuple[Side, ...]
    machine: str = ""
    more: str = ""


def _halves(place: str) -> tuple[Side, ...]:
    return Side(place, lambda runs: runs[::2]), Side(place, lambda runs: runs[1::2])


def _with(name: str, value: float | str) -> Chosen:
    return lambda runs: [r for r in runs if r.conditions.get(name) == value]


PAIRS = (
    *(
        Pair(
            f"every second run of {place.removeprefix('mrdlab-').split('.')[0]}, the others",
            "nothing",
            _halves(place),
        )
        for place in (L_4, L_2, RIGHT)
    ),
    Pair(
        "Tool_4_Maryland_L_4, Tool_4_Maryland_L_2",
        "another instrument",
        (Side(L_4), Side(L_2), Side(RIGHT)),
    ),
    Pair(
        "Tool_4_Maryland_L_2, Tool_5_Maryland_L_2",
        "another instrument",
        (Side(L_2), Side(RIGHT), Side(L_4)),
    ),
    Pair(
        "arm, 2018 and 2019",
        "not known",
        (Side("psm/one18.csv.xz"), Side("psm/one19.csv.xz"), Side("psm/two18.csv.xz")),
    ),
    Pair(
        "arm of 2019, with 105 g on its insertion",
        "a payload",
        (Side("psm/one19.csv.xz"), Side("psm/one19_insertion_105g.csv.xz")),
    ),
    Pair(
        "smart grasper, 5 and 22 May 2021",
        "not known; other distances of the jaw",
        (Side(GRASPER, _with("date", "05_05_2021")), Side(GRASPER, _with("date", "05_22_2021"))),
        "smart_grasper",
        f"lap_s = {LAP_S}\n",
    ),
    Pair(
        "STS3215, pendulums of 1.168 kg at .1 m and .969 kg at .15 m",
        "nothing: the weight is declared",
        (
            Side(SERVO, _with("pendulum_mass_kg", 1.1682)),
            Side(SERVO, _with("pendulum_mass_kg", 0.969)),
        ),
        "sts3215",
    ),
)


@dataclass(frozen=True)
class Answer:
    """A pair and what was found.

    Attributes:
        found: The answer; None where it was refused.
        refused: Why.
    """

    pair: Pair
    found: Difference | None
    refused: str
    seconds: float


def answers(data: Path, only: str, skipped: list[str]) -> Iterator[Answer]:
    """Yield the answer of each pair whose data are in a folder; name the others in `skipped`."""
    for pair in (pair for pair in PAIRS if only in pair.name):
        began = time.monotonic()
        with ExitStack() as stack:
            machine = _machine(pair, stack)
            places = [_place(data, side.place, stack) for side in pair.sides]
            if any(place is None for place in places):
                skipped.append(pair.name)
                continue
            found, refused = None, ""
            try:
                opened = [
                    _opened(place, side, machine)
                    for place, side in zip(places, pair.sides, strict=True)
                    if place is not None
                ]
                runs = [one.campaign.evidence for one in opened]
                found = compare(runs[0], runs[1], opened[0].models, *runs[2:])
            except EstimationError as error:
                refused = str(error)
        yield Answer(pair, found, refused, time.monotonic() - began)


def _place(data: Path, name: str, stack: ExitStack) -> Path | None:
    if "." in name:
        return data / name if (data / name).is_file() else None
    return stack.enter_context(unpacked(data / "machines", name))


def _machine(pair: Pair, stack: ExitStack) -> Path | None:
    if not pair.machine:
        return None
    if not pair.more:
        return Path(pair.machine)
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="machine-")))
    text = place_of(Path(pair.machine)).read_text(encoding="utf-8")
    changed = folder / f"{pair.machine}.toml"
    changed.write_text(text.replace("[data.runs]\n", f"[data.runs]\n{pair.more}"), encoding="utf-8")
    return changed


def _opened(place: Path, side: Side, machine: Path | None) -> Subject:
    whole = subject(place, machine=machine)
    return Subject(Campaign.of(side.chosen(list(whole.campaign.evidence))), whole.models)


def main() -> int:
    """Compare the pairs and write the page."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.measured_changes", description=__doc__
    )
    parser.add_argument("--data", type=Path, required=True, help="folder of the measured data")
    parser.add_argument("--only", default="", help="part of the name of the pairs to compare")
    parser.add_argument("--out", type=Path, help="Markdown file")
    options = parser.parse_args()
    found, skipped = list[Answer](), list[str]()
    for answer in answers(options.data, options.only, skipped):
        sys.stderr.write(f"{answer.pair.name}: {_words(answer)} ({answer.seconds:.0f} s)\n")
        found.append(answer)
    text = _markdown(found, skipped)
    if options.out:
        write_text_atomic(options.out, text)
    sys.stdout.write(text)
    return 0


def _words(answer: Answer) -> str:
    return answer.refused if answer.found is None else " ".join(lines(answer.found))


def _markdown(found: Sequence[Answer], skipped: Sequence[str]) -> str:
    rows = [[a.pair.name, a.pair.expected, _runs(a), _words(a), f"{a.seconds:.0f}"] for a in found]
    heads = ("campaigns", "expected", "runs", "answer", "s")
    tables = [TextTable("Answers", heads, rows)]
    for answer in found:
        if answer.found is not None and answer.found.predicted:
            table = prediction_table(answer.found)
            third = answer.pair.sides[2].place
            tables.append(
                TextTable(f"{answer.pair.name}: errors on {third}", table.columns, table.rows)
            )
    said = [f"Without data: {', '.join(skipped)}."] if skipped else []
    return to_page(["Changes in measured campaigns", *said], tables, Provenance.now(0))


def _runs(answer: Answer) -> str:
    if answer.found is None:
        return "-"
    return " and ".join(str(len(names)) for names in answer.found.runs.values())


if __name__ == "__main__":
    raise SystemExit(main())
