"""The page of estimators of one instrument on others."""

from statistics import median

from rig.output.page import Page
from rig.output.table import TextTable
from rig.studies.instruments.study import InstrumentStudy

TITLE = "An estimator of one instrument on others"
NOTE = (
    "Proximal torque from the measured current, RMSE in mN m over the closing samples of the runs"
    " not used; fitted again: on the instrument's other runs alone, in five folds. Of a network the"
    " output layer is adapted. The stiffness of the states' prior was chosen on the instruments of"
    " the public data that are shown here, so that column is somewhat too good there; that of the"
    " networks' on Tool_4_Maryland_L_2 alone."
)


def page(study: InstrumentStudy) -> Page:
    """Return the study's page."""
    parts = [
        f"{1e3 * median(row.rmse_n_m):.2f} mN m on {row.instrument} with {row.runs}"
        f" run{'s' if row.runs > 1 else ''}"
        for row in study.drawn
        if not row.usual
    ]
    reach = f", states reach {', '.join(parts)}" if parts else ""
    lead = f"Fitted on {study.source} and adapted{reach}: the median over choices of these runs."
    return Page(TITLE, [lead], [_table(study), _drawn_table(study)], study.provenance)


def _drawn_table(study: InstrumentStudy) -> TextTable:
    cells = []
    for row in study.drawn:
        middle, worst = median(row.rmse_n_m), row.rmse_n_m[-1]
        counts = ("at the usual zero" if row.usual else "all", str(row.runs))
        choices = str(len(row.rmse_n_m))
        errors = (f"{1e3 * error:.2f}" for error in (middle, row.rmse_n_m[0], worst))
        covered = "" if row.covered is None else f"{row.covered:.1%}"
        cells.append([row.instrument, *counts, choices, *errors, f"{worst / middle:.2f}", covered])
    columns = ["instrument", "runs", "runs used", "choices", "median", "best", "worst"]
    columns += ["worst over median", "interval of 95 % covers"]
    note = (
        "Products of physical states, RMSE in mN m on the runs not used: each single run in turn,"
        " and threes drawn at random. At the usual zero: without the runs before or after which a"
        " gear, coupling or cable slipped; neither adapted with nor reported on."
    )
    return TextTable("Which runs the states are adapted with", columns, cells, note)


def _table(study: InstrumentStudy) -> TextTable:
    cells = []
    for row in study.rows:
        found = row.result
        errors = [found.as_it_is, found.adapted, found.scratch]
        cells.append([
            row.kind,
            row.instrument,
            ", ".join(name.rsplit("/", 1)[-1] for name in found.used),
            *("" if score is None else f"{1e3 * score.rmse:.2f}" for score in errors),
            "" if found.covered is None else f"{found.covered:.1%}",
            str(len(found.unused)),
        ])  # fmt: skip
    columns = ["estimator", "instrument", "runs used", "unchanged", "adapted", "fitted again"]
    return TextTable(
        "Other instruments", [*columns, "interval of 95 % covers", "runs not used"], cells, NOTE
    )
