"""The page of the study of the closed loop."""

from rig.output.page import Page
from rig.output.table import TextTable
from rig.studies.loop.study import TIMELESS, LoopStudy, Row

TITLE = "The loop closed on measured data: from a linear model to named effects"


def page(study: LoopStudy) -> Page:
    """Return the study's page."""
    parts = [
        f"{row.task.name} over {row.task.samples} samples {_mn_m(row.linear)} to {_mn_m(row.rmse)}"
        for row in study.rows
    ]
    runs = len(study.sealed.confirm)
    lead = f"On {runs} held-out test runs, errors in mN m before and after: {'; '.join(parts)}."
    tables = [_errors(study), *(_effects(row) for row in study.rows)]
    return Page(TITLE, [lead, *_notes(study)], tables, study.provenance)


def _notes(study: LoopStudy) -> list[str]:
    sealed = study.sealed
    found = [
        f"Data: {study.source}. {len(sealed.discover)} training runs, {len(sealed.confirm)} test"
        " runs, which were used once, after the last effect was chosen; fingerprint of the split"
        f" {sealed.seal[:16]}.",
        "Errors are root mean squares over the samples after the zero-phase 50 Hz filter, each"
        " run's mean left in. No effect may read the torque it estimates, the jaw's encoder, or how"
        f" long a run has lasted ({', '.join(TIMELESS)} are left out).",
        "A limit of this evidence: the forms friction.position.sticking and friction.load.sticking"
        " and the cube of friction.position joined the catalogue after all runs of"
        " Tool_4_Maryland_L_4 had been looked at. Another campaign is the better judge of them.",
    ]
    found += [f"Left out: run {name}, {reason}." for name, reason in study.left_out.items()]
    return found


def _errors(study: LoopStudy) -> TextTable:
    rows = []
    for row in study.rows:
        task = row.task
        found = (row.linear, row.rmse, row.rmse_without_means, task.to_reach, task.beyond)
        improved = f"{row.runs_improved} of {len(row.rmse_by_run)}"
        rows.append([task.name, task.samples, *map(_mn_m, found), str(row.parameters), improved])
    columns = ["estimate", "samples", "linear", "with effects", "run means removed", "to reach"]
    columns += ["beyond", "parameters", "runs improved"]
    return TextTable("Errors on the held-out test runs, mN m", columns, rows)


def _effects(row: Row) -> TextTable:
    cells = [["linear model", "2", "", _mn_m(row.linear)]]
    cells += [
        [step.effect, str(step.parameters), f"{100 * step.gain:.1f}", _mn_m(step.rmse)]
        for step in row.steps
    ]
    return TextTable(
        f"{row.task.name}, {row.task.samples} samples: effects in the order found",
        ("effect", "parameters", "gain %", "rmse, mN m"),
        cells,
        f"Tried: {row.candidates} points of {row.families} families. Gain: share of the squared"
        " error of the model before it, on training runs left out in turn; rmse on the"
        " held-out test runs.",
    )


def _mn_m(torque_n_m: float) -> str:
    return f"{1e3 * torque_n_m:.2f}"
