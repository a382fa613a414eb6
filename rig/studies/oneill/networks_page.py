"""Networks on the data of O'Neill et al. 2018, by what was held out."""

from collections import Counter

from rig.output.table import TextTable
from rig.studies.oneill import paper
from rig.studies.oneill.network_jobs import STATE_NODES
from rig.studies.oneill.networks import NetworkRow, NetworkStudy
from rig.studies.oneill.paper import FOLDS, HELD_OUT, SHOWN, shown

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
