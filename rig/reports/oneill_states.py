"""Estimates from physical states as tables: errors by what was held out, intervals, ablation."""

from estimation.bank.fitting import CHOICES
from estimation.bank.states import EFFECTS
from estimation.derived import TRAVEL_WINDOW_S
from rig.reports.oneill_networks import SHOWN
from rig.reports.table import TextTable
from rig.studies.oneill_networks import NetworkStudy
from rig.studies.oneill_paper import DISTAL, JAW, PROXIMAL
from rig.studies.oneill_states import FOLDS, StateJob, StateRow, StateStudy, ablated

PROTOCOLS = ("run-wise", "lofo", "lopo")

GOALS = {
    ("neutral", PROXIMAL): 3.0,
    ("neutral", DISTAL): 2.75,
    ("neutral", JAW): 0.29,
    ("pitch", DISTAL): 3.5,
    ("pitch", JAW): 0.45,
    ("roll", DISTAL): 5.5,
    ("roll", JAW): 0.7,
}
"""Run-wise error aimed at, in the unit shown."""


def notes(study: StateStudy) -> list[str]:
    """Return what a reader must know about the rows."""
    return [
        *_lead(study),
        f"Physical states: {study.weights} weights of products of states and of a ripple in the"
        f" spindle's angle, linear, by ridge regression; penalty and share of the runs' means that"
        f" is left out are chosen in every fit, out of {len(CHOICES)}, by runs left out of it in"
        f" turn. Nothing looks back further than {TRAVEL_WINDOW_S} s. All closing samples of"
        " held-out runs are scored, against the sensor filtered without lag; live rows have inputs"
        " filtered causally, in fit and in use.",
        "Which states there are was chosen, out of some 150 sets, with the errors reported here in"
        " view: on held-out runs, frequencies and powers of the neutral pose by the command without"
        " lag, and of pitch and roll too. So these rows are somewhat too good; another instrument"
        " is the better judge.",
        *study.notes,
    ]


def _lead(study: StateStudy) -> list[str]:
    """Return the run-wise errors from the command in a sentence, where they were measured."""
    rows = {row.job: row for row in study.rows}
    told = []
    for filters in ("zero-phase", "live"):
        own = [rows.get(StateJob("neutral", "command", target, filters)) for target in SHOWN]
        if all(own):
            errors = [
                f"{name} {_scaled(row)} {unit}"
                for row, (name, unit, _) in zip(own, SHOWN.values(), strict=True)
            ]
            told.append(f"{filters}: {', '.join(errors)}")
    if not told:
        return []
    return [f"From the command by physical states, on whole runs not seen, {'; '.join(told)}."]


def tables(study: StateStudy, deep: NetworkStudy | None) -> list[TextTable]:
    """Return the tables.

    Args:
        study: The results.
        deep: Results of the networks, for the paper's network beside.
    """
    return [_errors(study, deep), _intervals(study), _ablation(study)]


def _name(row: StateRow) -> str:
    name, unit, _ = SHOWN[row.job.target]
    return f"{row.job.pose}: {name}, {unit}: {row.job.surrogate}, {row.job.filters}"


def _scaled(row: StateRow | None, value: str = "rmse") -> str:
    if row is None:
        return ""
    number = row.score.rmse if value == "rmse" else getattr(row, value)
    digits = 3 if row.job.target == JAW else 2
    return f"{SHOWN[row.job.target][2] * number:.{digits}f}"


def _worse(row: StateRow | None, first: StateRow) -> str:
    """Return an error on an unseen condition, and how much worse that is than on unseen runs."""
    if row is None:
        return ""
    return f"{_scaled(row)} ({100 * (row.score.rmse / first.score.rmse - 1):+.0f} %)"


def _errors(study: StateStudy, deep: NetworkStudy | None) -> TextTable:
    found: dict[str, dict[str, StateRow]] = {}
    for row in study.rows:
        if not row.job.without:
            found.setdefault(_name(row), {})[row.job.protocol] = row
    cells = []
    for name, by in found.items():
        first = by["run-wise"]
        goal = GOALS.get((first.job.pose, first.job.target))
        cells.append([
            name, _paper_network(first, deep), _scaled(first),
            *(_worse(by.get(p), first) for p in PROTOCOLS[1:]),
            "" if goal is None else f"{goal:g}", _scaled(first, "run_offset"),
        ])  # fmt: skip
    columns = ["RMSE", "paper's network, runs", "runs", "a frequency (LOFO)"]
    columns += ["a power level (LOPO)", "goal, runs", "of it the runs' offsets"]
    note = (
        f"Runs: {FOLDS} folds of whole runs, the same ones for the paper's network (30 nodes,"
        " trained without lag). The runs' offsets: root mean square of each held-out run's mean"
        " error; an estimate that forgets after half a second cannot know them."
    )
    return TextTable("Physical states: RMSE by what was held out", columns, cells, note)


def _paper_network(row: StateRow, deep: NetworkStudy | None) -> str:
    job = row.job
    for other in deep.rows if deep is not None else ():
        own = (other.pose, other.surrogate, other.target, other.way, other.protocol)
        if own == (job.pose, job.surrogate, job.target, "end-to-end", "run-wise"):
            return f"{SHOWN[job.target][2] * other.score.rmse:.2f}"
    return ""


def _intervals(study: StateStudy) -> TextTable:
    cells = [
        [
            f"{_name(row)}, {row.job.protocol}",
            *(f"{v:.1%}" for v in (row.covered, row.covered_median, row.covered_worst, row.inside)),
            _scaled(row, "rmse_inside"),
        ]
        for row in study.rows
        if not row.job.without
    ]
    columns = ["interval of 95 %", "covers", "median run", "worst run", "valid", "RMSE where valid"]
    note = (
        "Covers: share of the samples of held-out runs inside their interval. Valid: share inside"
        " the range of position, load, speed and acceleration that was fitted."
    )
    return TextTable(
        "Physical states: intervals and validity on held-out runs", columns, cells, note
    )


def _ablation(study: StateStudy) -> TextTable:
    by_target = {target: ablated(study.rows, target) for target in SHOWN}
    cells = [
        [
            effect or "nothing",
            *(_scaled(by.get(effect)) for by in by_target.values()),
        ]
        for effect in ("", *EFFECTS)
        if any(effect in by for by in by_target.values())
    ]
    columns = ["left out", *(f"{name}, {unit}" for name, unit, _ in SHOWN.values())]
    note = "Command, neutral pose, without lag, run-wise RMSE; each row is fitted anew."
    return TextTable("Physical states: what each effect brings", columns, cells, note)
