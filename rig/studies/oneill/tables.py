"""Tables I to V of O'Neill et al. 2018, reproduced, each row next to the printed one."""

from collections.abc import Iterator

from rig.output.table import TextTable
from rig.studies.oneill.networks import NetworkRow, NetworkStudy
from rig.studies.oneill.networks_page import SHOWN
from rig.studies.oneill.paper import DISTAL, JAW, PAPER, PROXIMAL
from rig.studies.oneill.study import PROTOCOLS, Study

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
            if row.protocol == protocol:
                printed = study.paper[row.surrogate]
                beside = (
                    [printed.mae, printed.p95, printed.rmse] if protocol == "random" else [None] * 3
                )
                fits = [printed.pearson_r, printed.spearman_rho] if protocol == "random" else []
                yield [
                    f"{kind}: {row.surrogate}",
                    *_cells(1e3, row.score.mae, row.score.p95, row.score.rmse),
                    f"{row.score.pearson_r:.2f}",
                    f"{row.score.spearman_rho:.2f}",
                    *_cells(1e3, *beside),
                    *([f"{value:.2f}" for value in fits] or ["", ""]),
                ]


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
            yield _beside(f"{label}: {surrogate}", trained[surrogate], PAPER[p, w, t, surrogate])


def _beside(label: str, row: NetworkRow, printed: tuple[float, float, float]) -> list[str]:
    score, scale = row.score, SHOWN[row.target][2]
    return [
        label,
        *_cells(scale, score.mae, score.p95, score.rmse),
        f"{score.pearson_r:.3f}",
        f"{score.spearman_rho:.3f}",
        *_cells(1.0, *printed),
        "",
        "",
    ]


def _cells(scale: float, *values: float | None) -> list[str]:
    return ["" if value is None else f"{scale * value:.2f}" for value in values]
