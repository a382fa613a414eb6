"""The simulated tables 3.1 to 3.3 of Piqué 2018, for any medium, and as Markdown."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rig.arm.simulated import CONTACT_SHARE, GRIP_N_M
from rig.output.figures import paired_bars, write_svgs
from rig.output.table import TextTable, to_markdown
from rig.studies.pique.wrench import (
    BODY,
    CONTACT,
    OURS,
    PUSHED,
    TABLES,
    THESIS,
    TWISTED,
    WITHIN,
    Cell,
    WrenchStudy,
)

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
    "In contact the thesis measured forces and moments separately, as here; it states up to"
    f" 7 N and a bad grip of the torsion about z, and no sizes. Largest forces {PUSHED[0]} N where"
    f" forces, {TWISTED[0]} N where moments are measured, and a torsion of {TWISTED[1]} N m,"
    f" of which the sensor gets at most {GRIP_N_M} N m, and joints that move over"
    f" {CONTACT_SHARE:.0%} of their ranges were set on arms that are not shown here so that its"
    " method comes near its table 3.3: the loss in the grip is an error of every method.",
    "By the body Jacobian the same contact is expressed in the tip's frame. Bending moments at the"
    " tip are zero there except for the sensor's errors, so they have no range for a ratio.",
)


def lead(study: WrenchStudy) -> str:
    """Return the study's result in a sentence."""
    near = [word for table in TABLES for word in study.fair[table]]
    by = {(cell.table, cell.method): np.array(cell.nrmsd_percent) for cell in study.cells}
    fair = {table: np.array(study.fair[table]) for table in TABLES}
    wins = [(by[table, OURS] < by[table, THESIS])[:, fair[table]] for table in TABLES]
    return (
        f"On {len(study.seeds)} simulated arms the thesis' own method lands within {WITHIN:.0%} of"
        f" the thesis in {sum(near)} of {len(near)} columns (median over arms). In those columns,"
        f" arm by arm, slip and joints weighed by their errors have the smaller error in"
        f" {sum(int(won.sum()) for won in wins)} of {sum(won.size for won in wins)}."
    )


def tables(study: WrenchStudy) -> list[TextTable]:
    """Return one table for each of the thesis'."""
    return [*(_table(study, name, paper) for name, paper in TABLES.items()), _body(study)]


def markdown(study: WrenchStudy, figures: Sequence[str] = ()) -> str:
    """Return the study as a Markdown page.

    Args:
        study: The study.
        figures: Places of its figures, from where the page will be.
    """
    shown = (to_markdown(table).rstrip() for table in tables(study))
    parts = [f"# {TITLE}", lead(study), *NOTES, *shown]
    parts += [f"![]({name})" for name in figures]
    return "\n\n".join([*parts, study.provenance.line()]) + "\n"


def write_figures(folder: Path, study: WrenchStudy) -> list[Path]:
    """Write the median errors of each table, by method."""
    drawn = {}
    for number, name in enumerate(TABLES, start=1):
        thesis, ours = (
            next(c.median for c in study.cells if (c.table, c.method) == (name, method))
            for method in (THESIS, OURS)
        )
        pairs = {label: (thesis[k], ours[k]) for k, label in enumerate(_columns(name))}
        drawn[f"wrench-3-{number}"] = paired_bars(
            pairs, ("thesis' method", "ours"), "NRMSD, %", f"Table {name}, medians"
        )
    return write_svgs(folder, drawn)


def _table(study: WrenchStudy, name: str, paper: tuple[float, ...]) -> TextTable:
    cells = [cell for cell in study.cells if cell.table == name]
    rows = [["thesis", *(f"{value:.2f}" for value in paper)], *_of_methods(cells)]
    rows.append(["within 25 % of the thesis", *("yes" if f else "no" for f in study.fair[name])])
    by_method = {cell.method: np.array(cell.nrmsd_percent) for cell in cells}
    better = np.sum(by_method[OURS] < by_method[THESIS], axis=0)
    rows.append(["seeds better than the thesis' method", *map(str, better)])
    title = f"Table {name}: NRMSD, %, {len(study.seeds)} seeds"
    return TextTable(title, ["", *_columns(name)], rows)


def _body(study: WrenchStudy) -> TextTable:
    """Return contact in the tip's frame: forces, and torsion about the shaft."""
    cells = [cell for cell in study.cells if cell.table == BODY]
    kept = (0, 1, 2, 3, 6)  # the method's name, three forces, the last moment
    rows = [[row[k] for k in kept] for row in _of_methods(cells)]
    title = f"Table {BODY}: NRMSD, %, {len(study.seeds)} seeds"
    return TextTable(title, ["", "Fx", "Fy", "Fz", "Tz"], rows)


def _of_methods(cells: Sequence[Cell]) -> list[list[str]]:
    rows = []
    for cell in cells:
        rows.append([f"{cell.method}, median", *(f"{value:.2f}" for value in cell.median)])
        rows.append([f"{cell.method}, least to most", *_range(cell)])
    return rows


def _columns(name: str) -> tuple[str, ...]:
    if name == CONTACT:
        return ("Fx", "Fy", "Fz", "Tx", "Ty", "Tz")
    return tuple(f"J{k}" for k in range(1, 7))


def _range(cell: Cell) -> list[str]:
    errors = np.array(cell.nrmsd_percent)
    return [f"{low:.1f}-{high:.1f}" for low, high in zip(errors.min(0), errors.max(0), strict=True)]
