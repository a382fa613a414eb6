"""How often intervals hold, as tables and as a page."""

from collections.abc import Iterator, Sequence

import numpy as np

from rig.output.table import TextTable, to_page
from rig.studies.instruments.intervals import COUNTS, Held, IntervalStudy
from rig.studies.oneill.networks_page import SHOWN

TITLE = "How often the intervals hold"
AIM = (0.93, 0.97)
WIDTH_AIM = 1.4
LEFT_OUT = {
    "run": "on unseen runs in range",
    "between": "on a frequency or load left out between others",
    "edge": "on the lowest or highest frequency or load left out",
}


def lead(study: IntervalStudy) -> list[str]:
    """Return the result in sentences."""
    usual = _usual(study)
    found = ["Products of physical states from the measured current; aimed at is 95 %."]
    for kind, what in LEFT_OUT.items():
        rows = [row for row in study.levels if row.left_out == kind]
        wide = np.mean([row.half_width / usual[row.instrument, row.target] for row in rows])
        found.append(f"{_shares(rows)} {what}, with {wide:.2f} times the width on unseen runs.")
    for count in COUNTS:
        rows = [row for row in study.adapted if row.left_out.startswith(f"{count} ")]
        ratio = max(row.rmse_ratio for row in rows)
        found.append(
            f"{_shares(rows)} adapted with {count} run{'s' if count > 1 else ''} chosen by"
            " `rig adapt --choose`, whose error is at most"
            f" {ratio:.2f} times the median of other choices."
        )
    found.append(
        f"The aims were {AIM[0]:.0%} to {AIM[1]:.0%} everywhere, a width of at most {WIDTH_AIM:g}"
        " times that on unseen runs, and 1.5 times the median error."
    )
    return found


def _shares(rows: Sequence[Held]) -> str:
    covered = [row.covered for row in rows]
    reached = sum(AIM[0] <= share <= AIM[1] for share in covered)
    return (
        f"They cover {np.mean(covered):.1%} ({min(covered):.0%} to {max(covered):.0%}; {reached} of"
        f" {len(rows)} rows within the aim)"
    )


def _usual(study: IntervalStudy) -> dict[tuple[str, str], float]:
    runs = [row for row in study.levels if row.left_out == "run"]
    return {(row.instrument, row.target): row.half_width for row in runs}


def tables(study: IntervalStudy) -> list[TextTable]:
    """Return the table of levels left out and that of other instruments."""
    usual = _usual(study)
    columns = ["instrument", "estimate", "left out", "runs", "RMSE", "covered", "median run"]
    columns += ["worst run", "worst fit", "half width", "of that on unseen runs", "none stated"]
    levels = [
        [*_cells(row), f"{row.half_width / usual[row.instrument, row.target]:.2f}", _none(row)]
        for row in study.levels
    ]
    note = (
        "Closing samples; each run counts alike. One fold of runs, or one level, is left out of a"
        " fit. Worst fit: the smallest mean share of what one fit left out. At rest and on opening"
        " no width is stated."
    )
    moved = [[*_cells(row), f"{row.rmse_ratio:.2f}", _none(row)] for row in study.adapted]
    more = [*columns[:2], "adapted with", *columns[3:10], "error over median", "none stated"]
    about = (
        "The rule reads angle, load and speed of the runs, not the target. Error over median: of"
        " every single run, or of as many threes drawn at random."
    )
    return [
        TextTable("Runs, frequencies and loads left out", columns, levels, note),
        TextTable("Adapted to another instrument", more, moved, about),
    ]


def _cells(row: Held) -> Iterator[str]:
    name, unit, scale = SHOWN[row.target]
    yield from (row.instrument, f"{name}, {unit}", row.left_out, str(row.runs))
    yield f"{scale * row.rmse:.2f}"
    yield from (f"{s:.1%}" for s in (row.covered, row.median, row.worst_run, row.worst_level))
    yield f"{scale * row.half_width:.2f}"


def _none(row: Held) -> str:
    return f"{row.no_width:.0%}"


def markdown(study: IntervalStudy) -> str:
    """Return the study as a Markdown page."""
    return to_page([TITLE, " ".join(lead(study))], tables(study), study.provenance)
