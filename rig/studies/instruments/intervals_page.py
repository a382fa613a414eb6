"""The page of how often intervals hold."""

from collections.abc import Iterable, Sequence

import numpy as np

from rig.output.page import Page
from rig.output.table import TextTable
from rig.studies.instruments.intervals import CHOSEN_ON, COUNTS, Held, IntervalStudy
from rig.studies.oneill.paper import SHOWN, shown

TITLE = "How often the intervals hold"
AIM = (0.93, 0.97)
WIDTH_AIM = 1.4
LEFT_OUT = {
    "run": "on unseen runs in range",
    "between": "on a frequency, load or jaw stop left out between others",
    "edge": "on the lowest or highest frequency, load or jaw stop left out",
}


def page(study: IntervalStudy) -> Page:
    """Return the study's page: the table of levels left out and that of other instruments."""
    usual = _usual(study)
    columns = ["instrument", "estimate", "left out", "runs", "RMSE", "covered", "standard error"]
    columns += ["median run", "worst run", "worst fit", "half width", "of that on unseen runs"]
    columns += ["none stated"]
    levels = [
        _cells(row, f"{row.half_width / usual[row.instrument, row.target]:.2f}")
        for row in study.levels
    ]
    note = (
        "Closing samples; each run counts alike. One fold of runs, or one level, is left out of a"
        " fit. Worst fit: the smallest mean share of what one fit left out. At rest and on opening"
        " no width is stated."
    )
    moved = [
        _cells(row, f"{row.rmse_ratio:.2f}", f"{row.worst_ratio:.2f}") for row in study.adapted
    ]
    more = [*columns[:2], "adapted with", *columns[3:11], "error over median", "worst over median"]
    more += ["none stated"]
    about = (
        "The rule reads angle, load and speed of the runs, not the target. Error over median: of"
        " every single run, or of as many threes drawn at random; worst: the worst of these."
    )
    tables = [
        TextTable("Runs, frequencies, loads and jaw stops left out", columns, levels, note),
        TextTable("Adapted to another instrument", more, moved, about),
    ]
    return Page(TITLE, [" ".join(_lead(study))], tables, study.provenance)


def _lead(study: IntervalStudy) -> list[str]:
    usual = _usual(study)
    found = [
        "Products of physical states from the measured current; aimed at is 95 %. A row is an"
        " estimate of an instrument or pose; rows of those that a choice was made on"
        f" ({', '.join(name.removeprefix('Tool_4_Maryland_L_') for name in CHOSEN_ON)}) are in the"
        " tables and not counted here."
    ]
    for kind, what in LEFT_OUT.items():
        rows = _counted(row for row in study.levels if row.left_out == kind)
        wide = np.mean([row.half_width / usual[row.instrument, row.target] for row in rows])
        found.append(f"{_shares(rows)} {what}, with {wide:.2f} times the width on unseen runs.")
    for count in COUNTS:
        rows = _counted(row for row in study.adapted if row.left_out.startswith(f"{count} "))
        ratio, worst = (
            max(getattr(row, name) for row in rows) for name in ("rmse_ratio", "worst_ratio")
        )
        found.append(
            f"{_shares(rows)} adapted with {count} run{'s' if count > 1 else ''} chosen by"
            f" `rig adapt --choose`, whose error is at most {ratio:.2f} times the median of other"
            f" choices, the worst of which has {worst:.2f} times the median."
        )
    found.append(
        f"The aims were {AIM[0]:.0%} to {AIM[1]:.0%} everywhere, a width of at most {WIDTH_AIM:g}"
        " times that on unseen runs, and 1.5 times the median error."
    )
    return found


def _counted(rows: Iterable[Held]) -> list[Held]:
    """Return rows of instruments that nothing was chosen on, with an interval on any sample."""
    return [
        row
        for row in rows
        if row.instrument.rsplit(" ", 1)[-1] not in CHOSEN_ON and np.isfinite(row.covered)
    ]


def _shares(rows: Sequence[Held]) -> str:
    covered = [row.covered for row in rows]
    missed = sum(
        row.covered < AIM[0] - 2 * row.spread or row.covered > AIM[1] + 2 * row.spread
        for row in rows
    )
    none = np.mean([row.no_width for row in rows])
    return (
        f"They cover {np.mean(covered):.1%} ({min(covered):.0%} to {max(covered):.0%}; {missed} of"
        f" {len(rows)} rows outside the aim by more than two standard errors; none is stated for"
        f" {none:.0%} of the samples)"
    )


def _usual(study: IntervalStudy) -> dict[tuple[str, str], float]:
    runs = [row for row in study.levels if row.left_out == "run"]
    return {(row.instrument, row.target): row.half_width for row in runs}


def _cells(row: Held, *compared: str) -> list[str]:
    name, unit, _ = SHOWN[row.target]
    shares = (row.covered, row.spread, row.median, row.worst_run, row.worst_level)
    return [
        *(row.instrument, f"{name}, {unit}", row.left_out, str(row.runs)),
        shown(row.target, row.rmse, 2),
        *(f"{s:.1%}" if np.isfinite(s) else "-" for s in shares),
        shown(row.target, row.half_width, 2) if np.isfinite(row.half_width) else "-",
        *compared,
        f"{row.no_width:.0%}",
    ]
