"""The results page: one line a version and generator, appended by `make measure`."""

import re
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from benchmarks.diagnosis.case import BLOCK, KINDS, MACHINE
from benchmarks.diagnosis.measure import Row
from benchmarks.rigs import JUDGE, part_of
from estimation.files import write_text_atomic

PAGE = Path("docs/results/diagnosis-versions.md")

SIMULATED = "## Simulated campaigns"
MACHINES = "## Machines of other people"

COLUMNS = {
    SIMULATED: [
        "version",
        "measured",
        "generator",
        "seed",
        "use",
        *KINDS.values(),
        "solved",
        "sure and wrong",
        "extra names",
        "error ratio",
        "CPU s a case",
    ],
    MACHINES: [
        "version",
        "measured",
        "machine, handed over as",
        "stated",
        "as known",
        "sure and wrong",
        "error on test runs",
        "CPU s",
    ],
}

HEAD = """# The diagnosis, version by version

Appended by `make measure` ([how](../measuring.md)): one line for each version of the code and
each generator of cases, so that every version is listed with the earlier ones. `+changes` is a
checkout with changes that were not committed.
"""

NOTES = {
    SIMULATED: """Cells are right / asked; a class that was not asked has a dash. Right is: the
name of the hidden effect (weak: at 30 % of its strength; pairs: both); outside the catalogue: the
right variables and no name; some runs: the name and the runs, one run may be off (another
laboratory's scorer counts the name); confounded: the whole set of effects that the runs cannot
distinguish and a next experiment (of drawn rigs, the sets of lines up to c1b6d65d also held
families with amplitudes that no machine has); clean: no finding. Solved: confounded cases that
are right after the proposed runs were recorded, of those for which runs were proposed. Sure and
wrong: cases with a wrong statement at a confidence of .9 or more. Extra names: wrong names in
addition to the hidden effects, over all cases. Error ratio: error on the test runs over the
residual of the declared model on the same campaign without the hidden effects, median of the
rightly named cases (their number). A judging seed of a generator is used once: `judge` on the
first line with both; `seen` on later lines. Processor time is of one call on one core of a
shared machine.""",
    MACHINES: """Measured data of machines that were built, recorded and published by others; the
conversions are in `benchmarks/diagnosis`. Error is the root mean square of the test runs'
residual, run means included, over that of the target, before and after what was found. A dash
stands where nobody knows the answer.""",
}


@dataclass(frozen=True)
class Measured:
    """What was measured.

    Attributes:
        seed: Seed of the draw, or None for a generator without one.
    """

    version: str
    generator: str
    seed: int | None = None


def append(page: Path, measured: Measured, rows: Sequence[Row]) -> None:
    """Write the lines of one measurement on a page; lines of the same one are replaced."""
    old = page.read_text() if page.exists() else ""
    lines = {section: _lines(old, section) for section in COLUMNS}
    machines = [row for row in rows if row.kind == MACHINE]
    simulated = [row for row in rows if row.kind != MACHINE]
    new = {MACHINES: [_machine(measured, row) for row in machines]}
    new[SIMULATED] = [_simulated(measured, simulated, lines[SIMULATED])] if simulated else []
    parts = [HEAD]
    for section, columns in COLUMNS.items():
        kept = lines[section]
        for cells in new[section]:
            kept = [line for line in kept if _key(section, line) != _key(section, cells)]
            kept.append(cells)
        rule = ["---"] * len(columns)
        table = "\n".join(f"| {' | '.join(cells)} |" for cells in (columns, rule, *kept))
        parts.append(f"{section}\n\n{table}\n\n{NOTES[section]}\n")
    write_text_atomic(page, "\n".join(parts))


def next_to_judge(page: Path) -> int:
    """Return the first judging block of seeds that no line of a page has."""
    text = page.read_text() if page.exists() else ""
    spent = {int(cells[3]) // BLOCK for cells in _lines(text, SIMULATED) if cells[3].isdigit()}
    return next(seed for seed in JUDGE[::BLOCK] if seed // BLOCK not in spent)


def _lines(text: str, section: str) -> list[list[str]]:
    """Return the cells of each line of a section's table."""
    found = re.search(rf"^{section}$(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    table = re.findall(r"^\| (.*) \|$", found.group(1), re.MULTILINE) if found else []
    return [line.split(" | ") for line in table[2:]]


def _key(section: str, cells: Sequence[str]) -> tuple[str, ...]:
    """Return the key of a line: version, generator and seed, or version and machine."""
    return (cells[0], *(cells[2:4] if section == SIMULATED else cells[2:3]))


def _simulated(
    measured: Measured, rows: Sequence[Row], earlier: Sequence[Sequence[str]]
) -> list[str]:
    use = "develop" if measured.seed is None else part_of(measured.seed)
    seed = "-" if measured.seed is None else str(measured.seed)
    same = [c for c in earlier if [*c[2:4]] == [measured.generator, seed]]
    if use == "judge" and any(c[0] != measured.version for c in same):
        use = "seen"
    solved = [row.solved for row in rows if row.solved is not None]
    ratios = [row.ratio for row in rows if row.ratio is not None]
    ratio = f"{statistics.median(ratios):.2f} ({len(ratios)})" if ratios else "-"
    return [
        measured.version,
        datetime.now(UTC).strftime("%Y-%m-%d"),
        measured.generator,
        seed,
        use,
        *(_share([bool(row.right) for row in rows if row.kind == kind]) for kind in KINDS),
        _share(solved),
        f"{sum(row.sure_and_wrong for row in rows)}/{len(rows)}",
        str(sum(row.extra for row in rows)),
        ratio,
        f"{statistics.fmean(row.cpu_s for row in rows):.0f}",
    ]


def _share(right: Sequence[bool]) -> str:
    return f"{sum(right)}/{len(right)}" if right else "-"


def _machine(measured: Measured, row: Row) -> list[str]:
    return [
        measured.version,
        datetime.now(UTC).strftime("%Y-%m-%d"),
        row.case,
        "no answer" if row.failed else "; ".join(row.named) or "nothing missing",
        "-" if row.right is None else "yes" if row.right else "no",
        "yes" if row.sure_and_wrong else "no",
        " ".join(row.note.replace("|", "/").split()),
        f"{row.cpu_s:.0f}",
    ]
