"""Tables I to V of O'Neill et al. 2018 next to the printed rows; networks by what was held out."""

from collections import Counter
from collections.abc import Iterator

from estimation.scores import Score
from rig.output.table import TextTable
from rig.studies.oneill import paper
from rig.studies.oneill.network_jobs import STATE_NODES
from rig.studies.oneill.networks import NetworkRow, NetworkStudy
from rig.studies.oneill.paper import (
    DISTAL,
    FOLDS,
    HELD_OUT,
    JAW,
    PAPER,
    PROTOCOLS,
    PROXIMAL,
    SHOWN,
    PaperRow,
    shown,
)
from rig.studies.oneill.study import Study

ORDER = {
    "I": ("experiment 1", PROXIMAL, (("neutral", "end-to-end"),)),
    "II": ("experiment 2", JAW, (("neutral", "staged"), ("neutral", "end-to-end"))),
    "III": ("experiment 2", DISTAL, (("neutral", "staged"), ("neutral", "end-to-end"))),
    "IV": ("experiment 3", JAW, (("pitch", "end-to-end"), ("roll", "end-to-end"))),
    "V": ("experiment 3", DISTAL, (("pitch", "end-to-end"), ("roll", "end-to-end"))),
}
"""Experiment, target, and pose and way of each block of rows, as the paper prints them."""

COLUMNS = ("MAE", "95th pct", "RMSE", "R", "rho")
SPLIT = (
    "The paper's split: 85 % of the samples at random to fit, 15 % to score, so neighbours of a"
    " scored sample are fitted. Blank: not printed, or not applicable."
)

WAYS = {
    "end-to-end": "the paper's inputs and 30 nodes",
    "+ acceleration": f"with motor acceleration, {STATE_NODES} nodes",
    "+ travel": f"with motor acceleration and the motor's travel of the last 0.5 s, {STATE_NODES}"
    " nodes",
    "causal": "the same, every input filtered and differentiated as live",
}


def notes(study: NetworkStudy) -> list[str]:
    """Return remarks on the networks."""
    settings = study.settings
    every = " and ".join(f"one of {n} ({pose})" for pose, n in study.every.items())
    told = [
        f"Networks: trained on {every} closing samples, scored on all held-out ones. Converged"
        f" means that the error fell by less than {settings.tolerance:.1%} in {settings.patience}"
        f" steps; at most {settings.iterations} steps. Truth is the sensor filtered without lag.",
        *study.notes,
    ]
    if study.grip_force is not None:
        force, share = study.grip_force
        told.append(
            f"Grip force at {1e3 * paper.GRIP_ARM_M:.0f} mm, from the command, random split: RMSE"
            f" {force:.2f} N, {share:.1%} of the peak (paper: {paper.PAPER_GRIP_N} N,"
            f" {paper.PAPER_GRIP_SHARE:.1%})."
        )
    loose = sum(row.networks - row.converged for row in study.rows)
    if loose:
        told.append(f"{loose} row entries are of networks stopped before they converged.")
    if study.not_run:
        missing = Counter(f"{job.pose}, {job.way}, {job.protocol}" for job in study.not_run)
        listed = "; ".join(f"{name} ({count})" for name, count in missing.items())
        told.append(f"Not run, or not in all folds (networks by target and surrogate): {listed}.")
    return told


def tables(study: NetworkStudy) -> list[TextTable]:
    """Return the errors by what was held out, a table for each pose."""
    found = [_held_out_table(study, pose) for pose in study.samples]
    return [table for table in found if table.rows]


def _held_out_table(study: NetworkStudy, pose: str) -> TextTable:
    found: dict[tuple[str, str, str], dict[str, NetworkRow]] = {}
    for row in study.rows:
        if row.pose == pose:
            found.setdefault((row.target, row.surrogate, row.way), {})[row.protocol] = row
    rows = []
    for (target, surrogate, way), by in sorted(found.items(), key=_order):
        name, unit, _ = SHOWN[target]
        cells = [shown(target, by[p].score.rmse, 2) if p in by else "" for p in HELD_OUT]
        rows.append([f"{name}, {unit}: {surrogate}, {way}", *cells])
    columns = ["RMSE", *HELD_OUT.values()]
    note = f"Runs: {FOLDS} folds of whole runs. " + "; ".join(f"{k}: {v}" for k, v in WAYS.items())
    return TextTable(f"Networks, {pose} pose: RMSE by what was held out", columns, rows, note + ".")


def _order(item: tuple[tuple[str, str, str], object]) -> tuple[int, int, str]:
    (target, surrogate, way), _ = item
    ways = ["end-to-end", "staged", *list(WAYS)[1:]]
    return list(SHOWN).index(target), ways.index(way), surrogate


def paper_tables(study: Study, deep: NetworkStudy | None) -> list[TextTable]:
    """Return Table I, and Tables II to V where networks were trained."""
    found = []
    for number, (experiment, target, blocks) in ORDER.items():
        name, unit, _ = SHOWN[target]
        rows = list(_linear(study)) if number == "I" else []
        for pose, way in blocks:
            rows += _block(deep, pose, way, target) if deep is not None else []
        note = SPLIT if number != "I" else f"{SPLIT} {_linear_note(study)}"
        columns = ["", *COLUMNS, *(f"paper {heading}" for heading in COLUMNS)]
        if rows:
            title = f"Table {number}: {name}, {unit}, {experiment}"
            found.append(TextTable(title, columns, rows, note))
    return found


def _linear(study: Study) -> Iterator[list[str]]:
    """Yield the linear rows by the paper's split, then by the authors' way."""
    for protocol, kind in (("random", "linear"), ("authors", "linear, the authors' way")):
        for row in study.rows:
            if row.protocol != protocol:
                continue
            stated = _scored(study.paper[row.surrogate]) if protocol == "random" else [""] * 5
            yield [f"{kind}: {row.surrogate}", *_scored(row.score), *stated]


def _linear_note(study: Study) -> str:
    others = ", ".join(f"{1e3 * e:.2f} ({name})" for name, e in study.others_reach_n_m.items())
    way = PROTOCOLS["authors"].capitalize()
    told = f"{way}; others publish {others} for it on the public data."
    if not study.measured:
        told += " The paper's rows are of its own instrument, not of this data."
    return told


def _block(deep: NetworkStudy, pose: str, way: str, target: str) -> Iterator[list[str]]:
    """Yield the rows of one block in the paper's order, as far as they were trained."""
    trained = {
        row.surrogate: row
        for row in deep.rows
        if (row.pose, row.way, row.target, row.protocol) == (pose, way, target, "random")
    }
    label = "network" if target == PROXIMAL else way if pose == "neutral" else f"varied {pose}"
    for p, w, t, surrogate in PAPER:
        if (p, w, t) == (pose, way, target) and surrogate in trained:
            found = _scored(trained[surrogate].score, SHOWN[target][2], 3)
            stated = [f"{value:.2f}" for value in PAPER[p, w, t, surrogate]]
            yield [f"{label}: {surrogate}", *found, *stated, "", ""]


def _scored(found: Score | PaperRow, scale: float = 1e3, digits: int = 2) -> list[str]:
    errors = (f"{scale * value:.2f}" for value in (found.mae, found.p95, found.rmse))
    return [*errors, *(f"{r:.{digits}f}" for r in (found.pearson_r, found.spearman_rho))]
