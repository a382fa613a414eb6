"""Tables I to V of O'Neill et al. 2018, reproduced, each row next to the printed one."""

from collections.abc import Iterator

from estimation.scores import Score
from rig.output.table import TextTable
from rig.studies.oneill.networks import NetworkStudy
from rig.studies.oneill.paper import DISTAL, JAW, PAPER, PROTOCOLS, PROXIMAL, SHOWN, PaperRow
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
NOTE = (
    "The paper's split: 85 % of the samples at random to fit, 15 % to score, so neighbours of a"
    " scored sample are fitted. Blank: not printed, or not applicable."
)


def tables(study: Study, deep: NetworkStudy | None) -> list[TextTable]:
    """Return Table I, and Tables II to V where networks were trained."""
    found = []
    for number, (experiment, target, blocks) in ORDER.items():
        name, unit, _ = SHOWN[target]
        rows = list(_linear(study)) if number == "I" else []
        for pose, way in blocks:
            rows += _block(deep, pose, way, target) if deep is not None else []
        note = NOTE if number != "I" else f"{NOTE} {_linear_note(study)}"
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
