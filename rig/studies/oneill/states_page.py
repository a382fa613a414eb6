"""Estimates from physical states as tables: errors by what was held out, intervals, ablation."""

from collections.abc import Sequence

from estimation.bank.fitting import CHOICES
from estimation.bank.states import EFFECTS
from estimation.derived import TRAVEL_WINDOW_S
from rig.output.table import TextTable
from rig.studies.oneill.paper import CONDITIONS, FOLDS, HELD_OUT, SHOWN, shown
from rig.studies.oneill.state_rows import Level, StateRow, ablated
from rig.studies.oneill.states import StateStudy


def notes(study: StateStudy) -> list[str]:
    """Return remarks on the rows."""
    return [
        f"Physical states: {study.weights} weights of products of states and of a ripple in the"
        f" spindle's angle, linear, by ridge regression; penalty and removed share of the runs'"
        f" means are chosen in every fit, out of {len(CHOICES)}, by runs left out of it in"
        f" turn. No input is older than {TRAVEL_WINDOW_S} s. All closing samples of"
        " held-out runs are scored, against the sensor filtered without lag; live rows have inputs"
        " filtered causally, in fit and in use.",
        "Which states there are was chosen, out of some 150 sets, with the errors reported here"
        " known: on held-out runs, frequencies and powers of the neutral pose by the command"
        " without lag, and of pitch and roll too. So these errors are biased low; another"
        " instrument is a more independent test.",
        *study.notes,
    ]


def tables(study: StateStudy) -> list[TextTable]:
    """Return the tables."""
    found = [_errors(study), _levels(study), _intervals(study), _ablation(study)]
    return [table for table in found if table.rows]


def _name(row: StateRow) -> str:
    name, unit, _ = SHOWN[row.job.target]
    return f"{row.job.pose}: {name}, {unit}: {row.job.surrogate}, {row.job.filters}"


def _scaled(row: StateRow | None, value: str = "rmse") -> str:
    if row is None:
        return ""
    return shown(row.job.target, row.score.rmse if value == "rmse" else getattr(row, value))


def _worse(row: StateRow | None, first: StateRow) -> str:
    """Return an error on an unseen condition, and how much worse that is than on unseen runs."""
    if row is None:
        return ""
    return f"{_scaled(row)} ({100 * (row.score.rmse / first.score.rmse - 1):+.0f} %)"


def _errors(study: StateStudy) -> TextTable:
    found: dict[str, dict[str, StateRow]] = {}
    for row in study.rows:
        if not row.job.without:
            found.setdefault(_name(row), {})[row.job.protocol] = row
    cells = []
    for name, by in found.items():
        first = by["run-wise"]
        unseen = [_worse(by.get(p), first) for p in CONDITIONS]
        cells.append([name, _scaled(first), *unseen, _scaled(first, "run_offset")])
    columns = ["RMSE", *list(HELD_OUT.values())[1:], "runs' offsets"]
    note = (
        f"Runs: {FOLDS} folds of whole runs, as of the networks. The runs' offsets: root mean"
        " square of each held-out run's mean error; an estimate with a memory of half a second"
        " cannot estimate them."
    )
    return TextTable("Physical states: RMSE by what was held out", columns, cells, note)


def _levels(study: StateStudy) -> TextTable:
    """Return errors at the ends of the levels, where a fit reaches beyond them, and between."""
    cells = []
    for row in study.rows:
        if row.levels and row.job.filters == "live":
            parts = (row.levels[:1], row.levels[1:-1], row.levels[-1:])
            told = (cell for part in parts for cell in _level_cells(row, part))
            cells.append([f"{_name(row)}, {row.job.protocol}", *told])
    columns = ["left out", "the lowest", "covers", "one between", "covers", "the highest", "covers"]
    note = (
        "RMSE of the frequency (lofo) or power level (lopo) left out, and what its interval of 95 %"
        " covers: beyond the levels that were fitted on, and between them. An interval is"
        " made of how runs that were fitted differ; runs beyond all of them are no such runs."
    )
    return TextTable("Physical states, live: between levels and beyond them", columns, cells, note)


def _level_cells(row: StateRow, levels: Sequence[Level]) -> list[str]:
    samples = sum(level.samples for level in levels)
    if not samples:
        return ["", ""]
    square = sum(level.samples * level.rmse**2 for level in levels) / samples
    covered = sum(level.samples * level.covered for level in levels) / samples
    return [shown(row.job.target, square**0.5), f"{covered:.0%}"]


def _intervals(study: StateStudy) -> TextTable:
    cells = []
    for row in (row for row in study.rows if not row.job.without):
        between = " to ".join(f"{share:.0%}" for share in row.covered_between)
        shares = (f"{v:.1%}" for v in (row.covered_median, row.covered_worst, row.inside))
        told = [f"{row.covered:.1%}", between, *shares, _scaled(row, "rmse_inside")]
        cells.append([f"{_name(row)}, {row.job.protocol}", *told])
    columns = ["interval of 95 %", "covers", "by chance", "median run", "worst run", "valid"]
    columns.append("RMSE where valid")
    note = (
        "Covers: share of the samples of held-out runs inside their interval; by chance: what 95 %"
        " of campaigns drawn from these runs would cover. Valid: share inside"
        " the range of position, load, speed and acceleration that was fitted."
    )
    title = "Physical states: intervals and validity on held-out runs"
    return TextTable(title, columns, cells, note)


def _ablation(study: StateStudy) -> TextTable:
    by_target = {target: ablated(study.rows, target) for target in SHOWN}
    cells = [
        [effect or "nothing", *(_scaled(by.get(effect)) for by in by_target.values())]
        for effect in ("", *EFFECTS)
        if any(effect in by for by in by_target.values())
    ]
    columns = ["left out", *(f"{name}, {unit}" for name, unit, _ in SHOWN.values())]
    note = "Command, neutral pose, without lag, run-wise RMSE; each row is a new fit."
    return TextTable("Physical states: improvement by each effect", columns, cells, note)
