"""The simulated tables 3.1 to 3.3 of Piqué 2018, for any medium, and as Markdown."""

import numpy as np

from rig.reports.table import TextTable, to_markdown
from rig.studies.pique_wrench import CONTACT, OURS, THESIS, Cell, WrenchStudy

TITLE = "Free space and contact on simulated arms: tables 3.1 to 3.3 of Piqué 2018"

NOTES = (
    "Every seed draws an arm: parameters near the thesis' table 2.2, and hidden friction with"
    " memory (Dahl), friction by another joint's position, and drift, which no model declares."
    " Their sizes were set over several rounds on these seeds so that the thesis' own method meets"
    " its table 3.2; motion of the hand and of the contact is assumed. A column"
    " counts for a comparison only where the thesis'"
    " method lands within 25 % of the thesis' number.",
    "The force sensor has noise, bias, drift, cross-talk of 1 % and a frame turned and moved;"
    " wrenches are in the base frame. Both sides pass a zero-phase Butterworth filter at 5 Hz;"
    " causal: both pass a window of past samples instead, an eighth of a second late.",
    "In contact the thesis measured forces and moments apart, does not state how large they were,"
    " and writes that the torsion about z was badly gripped and not transmitted faithfully; here"
    " both act at once and the sensor feels all of it, so Tz comes out far better and Fy and Fz"
    " worse than its table. No setting of the contact was searched to undo that.",
)


def tables(study: WrenchStudy) -> list[TextTable]:
    """Return one table for each of the thesis'."""
    from rig.studies.pique_wrench import TABLES

    return [_table(study, name, paper) for name, paper in TABLES.items()]


def markdown(study: WrenchStudy) -> str:
    """Return the study as a Markdown page."""
    parts = [f"# {TITLE}", *NOTES, *(to_markdown(table).rstrip() for table in tables(study))]
    return "\n\n".join([*parts, study.provenance.line()]) + "\n"


def _table(study: WrenchStudy, name: str, paper: tuple[float, ...]) -> TextTable:
    columns = ("Fx", "Fy", "Fz", "Tx", "Ty", "Tz") if name == CONTACT else _joints()
    rows = [["thesis", *(f"{value:.2f}" for value in paper)]]
    cells = [cell for cell in study.cells if cell.table == name]
    for cell in cells:
        rows.append([f"{cell.method}, median", *(f"{value:.2f}" for value in cell.median)])
        rows.append([f"{cell.method}, least to most", *_range(cell)])
    rows.append(["within 25 % of the thesis", *("yes" if f else "no" for f in study.fair[name])])
    by_method = {cell.method: np.array(cell.nrmsd_percent) for cell in cells}
    better = np.sum(by_method[OURS] < by_method[THESIS], axis=0)
    rows.append(["seeds better than the thesis' method", *map(str, better)])
    title = f"Table {name}: NRMSD, %, {len(study.seeds)} seeds"
    return TextTable(title, ["", *columns], rows)


def _joints() -> tuple[str, ...]:
    return tuple(f"J{k}" for k in range(1, 7))


def _range(cell: Cell) -> list[str]:
    errors = np.array(cell.nrmsd_percent)
    return [f"{low:.1f}-{high:.1f}" for low, high in zip(errors.min(0), errors.max(0), strict=True)]
