"""The linear rows of Table I of O'Neill et al. 2018, made again on measured or simulated data.

The public data set is probably not the paper's exact set: the paper's processing gives 308,117
closing samples of Tool_4_Maryland_L_4, the paper states 260,581, and no threshold, window or subset
of runs explains the difference. The same processing gives the paper's count of its third experiment
exactly. So the paper's errors are printed next to ours, and are not expected to agree.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from estimation.campaign import Campaign, CampaignError, Split, Table
from estimation.channels import unit_of
from estimation.derived import measured_channels
from estimation.scores import Score, rmse
from estimation.units import evaluate
from rig.errors import DataError
from rig.output.provenance import Provenance
from rig.studies.oneill import fits
from rig.studies.oneill.source import Source

PAPER_SAMPLES = 260_581
PUBLIC_SAMPLES = 308_117

FOLDS = 5
CONDITIONS = {"lofo": "frequency_hz", "lopo": "load_command_a"}
"""Condition each leave-one-out protocol holds out: one frequency, one power level."""

PROTOCOLS = {
    "authors": "the authors' way: fitted and scored on the last 7/8 of the closing samples",
    "random": "the paper's split: 85 % of the samples at random to fit, 15 % to score",
    "run-wise": f"{FOLDS} folds of whole runs",
    "lofo": "one frequency left out at a time",
    "lopo": "one power level left out at a time",
}


@dataclass(frozen=True)
class PaperRow:
    """One linear row of the paper's Table I, torques in N m."""

    mae: float
    p95: float
    rmse: float
    pearson_r: float
    spearman_rho: float


PAPER_TABLE_I = {
    "command": PaperRow(10.03e-3, 22.94e-3, 12.18e-3, 0.97, 0.97),
    "current": PaperRow(10.06e-3, 23.26e-3, 12.26e-3, 0.97, 0.97),
    "gearbox": PaperRow(33.91e-3, 76.30e-3, 40.53e-3, 0.60, 0.62),
}

OTHERS_REACH_N_M = {"command": 14.17e-3, "current": 14.24e-3, "gearbox": 43.14e-3}
"""RMSE of the authors' linear fit on the public data as others have reproduced it, N m."""


@dataclass(frozen=True)
class Row:
    """One linear fit and its error.

    Attributes:
        surrogate: Short name of the torque surrogate.
        protocol: Short name of the protocol, see `PROTOCOLS`.
        runs: Number of runs.
        gain: Fitted gain; None where several fits were made.
        gain_unit: Its unit.
        offset_n_m: Fitted offset; None where several fits were made.
        score: Errors in N m.
    """

    surrogate: str
    protocol: str
    runs: int
    gain: float | None
    gain_unit: str
    offset_n_m: float | None
    score: Score


@dataclass(frozen=True)
class Study:
    """Results of the study.

    Attributes:
        schema: Name of this layout.
        source: What the data is.
        measured: Whether the data was measured on the paper's instrument.
        notes: Remarks for a comparison.
        closing_samples: Closing samples of all runs after the paper's processing.
        paper_samples: The paper's count.
        public_samples: The count the public data is known to give.
        runs: Names of the runs behind the run-wise rows.
        left_out: Runs left out of these rows, with the reason.
        rows: The linear fits.
        paper: The paper's rows by surrogate.
        others_reach_n_m: RMSE of others' reproduction of the authors' way.
        rmse_by_run_n_m: Run-wise error of each run with the measured current, or with what there
            is in its place.
        provenance: When and from what this was made.
    """

    schema: str
    source: str
    measured: bool
    notes: tuple[str, ...]
    closing_samples: int
    paper_samples: int
    public_samples: int
    runs: tuple[str, ...]
    left_out: dict[str, str]
    rows: tuple[Row, ...]
    paper: dict[str, PaperRow]
    others_reach_n_m: dict[str, float]
    rmse_by_run_n_m: dict[str, float]
    provenance: Provenance


def run_study(
    source: Source,
    *,
    seed: int = 0,
    on_run: Callable[[str], None] = lambda name: None,
) -> Study:
    """Do the study.

    Args:
        source: Runs with a spindle angle, a proximal torque and at least one surrogate.
        seed: Seed of the random split and of the folds.
        on_run: Called with each run's name when it has been processed.

    Raises:
        DataError: No surrogate, too few runs, or no closing sample.
        MissingChannelError: A run lacks the spindle angle or the proximal torque.
    """
    campaign, remarks = source.campaign, list(source.notes)
    surrogates = _surrogates(campaign, remarks)
    names = [fits.TARGET, *surrogates.values()]
    closing = fits.closing_campaign(campaign, names, on_run=lambda run: on_run(run.name))
    kept, left_out = without_flagged(closing)
    splits = _splits(kept, seed, remarks)
    rows = []
    for surrogate, channel in surrogates.items():
        rows += _whole_rows(surrogate, channel, closing, kept, seed)
        rows += [
            _split_row(surrogate, channel, protocol, parts) for protocol, parts in splits.items()
        ]
    shown = "current" if "current" in surrogates else next(iter(surrogates))
    by_run = _rmse_by_run(_held_out(splits["run-wise"], surrogates[shown]))
    return Study(
        schema="rig.study.oneill/1",
        source=source.name,
        measured=source.measured,
        notes=tuple(remarks),
        closing_samples=sum(len(run) for run in closing),
        paper_samples=PAPER_SAMPLES,
        public_samples=PUBLIC_SAMPLES,
        runs=kept.names,
        left_out=left_out,
        rows=tuple(rows),
        paper=PAPER_TABLE_I,
        others_reach_n_m=OTHERS_REACH_N_M,
        rmse_by_run_n_m=by_run,
        provenance=Provenance.now(seed),
    )


def _surrogates(campaign: Campaign, notes: list[str]) -> dict[str, str]:
    """Return the surrogates whose channels the first run has; note the ones that are missing."""
    if len(campaign) == 0:
        raise DataError("The campaign is empty.")
    columns = set(next(iter(campaign)).columns)
    found = {
        name: channel
        for name, channel in fits.SURROGATES.items()
        if set(measured_channels([channel])) <= columns
    }
    for name in fits.SURROGATES.keys() - found.keys():
        notes.append(f"The recordings carry no {name}; its rows are left out.")
    if not found:
        raise DataError(
            "The recordings carry none of the paper's torque surrogates.",
            f"Needed is one of: {', '.join(fits.SURROGATES.values())}.",
        )
    return found


def without_flagged(closing: Campaign) -> tuple[Campaign, dict[str, str]]:
    """Exclude runs with flagged closing samples, with the reason."""
    left_out = {}
    for run in closing:
        flagged = [s for s in run.stretches if np.any(run.flags & np.uint8(s.flag))]
        if run.excluded is not None:
            left_out[run.name] = run.excluded
        elif not run.valid.all():
            reasons = "; ".join(s.reason for s in flagged) or "flagged samples"
            left_out[run.name] = reasons
    kept = closing.exclude(left_out).evidence
    if len(kept) < 2 or sum(len(run) for run in kept) == 0:
        raise DataError(
            f"{len(kept)} of {len(closing)} runs can be used: too few to hold runs out.",
            "Each needs closing motion faster than 0.25 rad/s between its first and last second.",
        )
    return kept, left_out


def _splits(kept: Campaign, seed: int, notes: list[str]) -> dict[str, list[Split]]:
    splits = {"run-wise": kept.folds(min(FOLDS, len(kept)), seed)}
    for protocol, condition in CONDITIONS.items():
        try:
            splits[protocol] = kept.leave_one_condition_out(condition)
        except CampaignError as error:
            notes.append(f"No {protocol} rows: {error.what}")
    return splits


def _whole_rows(
    surrogate: str, channel: str, closing: Campaign, kept: Campaign, seed: int
) -> list[Row]:
    """Return the rows of the paper's own protocols: the authors' fit and the random split.

    The authors' fit takes all runs in file order, flagged ones too, as the paper has no flags.
    """
    rows = []
    for protocol, campaign in (("authors", closing), ("random", kept)):
        table = campaign.concatenate([channel, fits.TARGET], valid_only=False)
        x, y = table.columns[channel], table.columns[fits.TARGET]
        if protocol == "authors":
            line, score = fits.score_authors(x, y)
        else:
            line, score = fits.score_random(x, y, seed)
        unit = _gain_unit(channel)
        rows.append(Row(surrogate, protocol, len(campaign), line.gain, unit, line.offset, score))
    return rows


def _split_row(surrogate: str, channel: str, protocol: str, splits: list[Split]) -> Row:
    table = _held_out(splits, channel)
    score = fits.score_table(table)
    return Row(surrogate, protocol, len(table.names), None, _gain_unit(channel), None, score)


def _held_out(splits: list[Split], channel: str) -> Table:
    return fits.held_out(splits, [channel], fits.linear_fitter(channel))


def _gain_unit(channel: str) -> str:
    return evaluate("target / source", {"target": "N m", "source": unit_of(channel)})


def _rmse_by_run(table: Table) -> dict[str, float]:
    estimate, truth = table.columns[fits.ESTIMATE], table.columns[fits.TARGET]
    parts = {name: table.run == index for index, name in enumerate(table.names)}
    return {n: rmse(estimate[p], truth[p]) for n, p in sorted(parts.items()) if p.any()}
