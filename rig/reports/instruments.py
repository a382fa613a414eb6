"""Estimators of one instrument on others, as a table and as a page."""

from rig.reports.table import TextTable, to_markdown
from rig.studies.instruments import InstrumentStudy

TITLE = "An estimator of one instrument on others"
NOTE = (
    "Proximal torque from the measured current, RMSE in mN m over the closing samples of the runs"
    " not used; fitted anew: on the instrument's other runs alone, in five folds. Of a network the"
    " output layer is adapted. The stiffness of the states' prior was chosen on the instruments of"
    " the public data that are shown here, so that column is somewhat too good there."
)


def lead(study: InstrumentStudy) -> str:
    """Return the result in a sentence."""
    states = [row for row in study.rows if row.result.kind == "states"]
    best = {
        row.instrument: f"{1e3 * row.result.adapted.rmse:.2f} mN m on {row.instrument}"
        for row in sorted(states, key=lambda row: -row.result.adapted.rmse)
    }
    return (
        f"Fitted on {study.source} and adapted with its best choice of runs, states reach"
        f" {', '.join(best.values())}."
    )


def table(study: InstrumentStudy) -> TextTable:
    """Return the errors."""
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
    columns = ["estimator", "instrument", "runs used", "as it is", "adapted", "fitted anew"]
    return TextTable(
        "Other instruments", [*columns, "interval of 95 % covers", "runs not used"], cells, NOTE
    )


def markdown(study: InstrumentStudy) -> str:
    """Return the study as a Markdown page."""
    parts = [f"# {TITLE}", lead(study), to_markdown(table(study)).rstrip()]
    return "\n\n".join([*parts, study.provenance.line()]) + "\n"
