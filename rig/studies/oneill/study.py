"""The linear rows of Table I of O'Neill et al. 2018, made again on measured or simulated data.

The public data set is probably not the paper's exact set: the paper's processing gives 308,117
closing samples of Tool_4_Maryland_L_4, the paper states 260,581, and no threshold, window or subset
of runs explains the difference. The same processing gives the paper's count of its third experiment
exactly. So the paper's errors are printed next to ours, and are not expected to agree.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from estimation.campaign import Campaign
from estimation.channels import evaluate, unit_of
from estimation.derived import measured_channels
from estimation.errors import EstimationError
from estimation.recording import FloatArray
from estimation.scores import Score, rmse, score
from rig.errors import DataError
from rig.output.provenance import Provenance
from rig.studies.oneill import paper
from rig.studies.oneill.data import ClosingTable, Source, closing_table, held_out_masks
from rig.studies.oneill.paper import CONDITIONS, HELD_OUT, PROXIMAL, SURROGATES, PaperRow

Mask = NDArray[np.bool_]


class StudyError(EstimationError):
    """After the paper's processing no samples remain to fit or to score."""


@dataclass(frozen=True)
class Row:
    """One linear fit and its error."""

    surrogate: str
    protocol: str  # short name of the protocol, see `PROTOCOLS`
    runs: int
    gain: float | None  # fitted gain; None where several fits were made
    gain_unit: str
    offset_n_m: float | None  # fitted offset; None where several fits were made
    score: Score


@dataclass(frozen=True)
class Study:
    """Results of the study."""

    schema: str
    source: str
    measured: bool
    notes: tuple[str, ...]
    closing_samples: int  # closing samples of all runs after the paper's processing
    paper_samples: int
    public_samples: int  # the count the public data is known to give
    runs: tuple[str, ...]  # names of the runs behind the run-wise rows
    left_out: dict[str, str]  # runs left out of these rows, with the reason
    rows: tuple[Row, ...]
    paper: dict[str, PaperRow]  # the paper's rows by surrogate
    others_reach_n_m: dict[str, float]  # RMSE of others' reproduction of the authors' way
    # run-wise error of each run with the measured current, or with what there is in its place
    rmse_by_run_n_m: dict[str, float]
    provenance: Provenance


def run_study(
    source: Source, *, seed: int = 0, on_run: Callable[[str], None] = lambda name: None
) -> Study:
    """Do the study on runs with a spindle angle, a proximal torque and at least one surrogate.

    Raises:
        DataError: No surrogate, too few runs, or no closing sample.
        MissingChannelError: A run lacks the spindle angle or the proximal torque.
    """
    campaign, remarks = source.campaign, list(source.notes)
    surrogates = _surrogates(campaign, remarks)
    whole = closing_table(campaign, [PROXIMAL, *surrogates.values()], on_run=on_run, live=False)
    reasons = {**whole.excluded, **whole.flagged}
    left_out = {name: reasons[name] for name in whole.names if name in reasons}
    kept = whole.without(left_out)
    if len(kept.names) < 2 or len(kept.run) == 0:
        raise DataError(
            f"{len(kept.names)} of {len(campaign)} runs can be used: too few to hold runs out.",
            "Each needs closing motion faster than 0.25 rad/s between its first and last second.",
        )
    splits = {protocol: held_out_masks(kept, protocol, seed) for protocol in HELD_OUT}
    for protocol, condition in CONDITIONS.items():
        if not splits[protocol]:
            remarks.append(f"No {protocol} rows: not every run states one of several {condition}.")
    rows = [
        row
        for surrogate, channel in surrogates.items()
        for row in _rows(surrogate, channel, whole.without(whole.excluded), kept, splits)
    ]
    shown = surrogates.get("current", next(iter(surrogates.values())))
    return Study(
        schema="rig.study.oneill/1",
        source=source.name,
        measured=source.measured,
        notes=tuple(remarks),
        closing_samples=len(whole.run),
        paper_samples=paper.PAPER_SAMPLES,
        public_samples=paper.PUBLIC_SAMPLES,
        runs=kept.names,
        left_out=left_out,
        rows=tuple(rows),
        paper=paper.PAPER_TABLE_I,
        others_reach_n_m=paper.OTHERS_REACH_N_M,
        rmse_by_run_n_m=_rmse_by_run(kept, shown, splits["run-wise"]),
        provenance=Provenance.now(seed),
    )


def _surrogates(campaign: Campaign, notes: list[str]) -> dict[str, str]:
    """Return the surrogates whose channels the first run has; note the ones that are missing."""
    if len(campaign) == 0:
        raise DataError("The campaign is empty.")
    columns = set(next(iter(campaign)).columns)
    found = {
        name: channel
        for name, channel in SURROGATES.items()
        if set(measured_channels([channel])) <= columns
    }
    missing = SURROGATES.keys() - found.keys()
    notes += [f"The recordings carry no {name}; its rows are left out." for name in missing]
    if not found:
        raise DataError(
            "The recordings carry none of the paper's torque surrogates.",
            f"Needed is one of: {', '.join(SURROGATES.values())}.",
        )
    return found


def fit_line(surrogate: FloatArray, torque: FloatArray) -> Polynomial:
    """Fit the paper's line by least squares: torque (n,) = gain x surrogate (n,) + offset, SI.

    Raises:
        StudyError: Fewer than two samples, or the surrogate does not vary.
    """
    if len(surrogate) < 2 or np.ptp(surrogate) == 0:
        raise StudyError(
            f"A line cannot be fitted to {len(surrogate)} closing samples.",
            "The spindle never closes fast enough, or the surrogate is constant.",
        )
    centre = surrogate.mean()
    gain = float((surrogate - centre) @ torque / np.sum((surrogate - centre) ** 2))
    return Polynomial([float(torque.mean() - gain * centre), gain])


def _rows(
    surrogate: str,
    channel: str,
    whole: ClosingTable,
    kept: ClosingTable,
    splits: dict[str, list[Mask]],
) -> Iterator[Row]:
    """Yield a row a protocol; the authors' fit takes all runs, as the paper has no flags."""
    unit = evaluate("target / source", {"target": "N m", "source": unit_of(channel)})
    late = np.arange(len(whole.run)) >= round(len(whole.run) * paper.AUTHORS_SKIP)
    tried = {"authors": (whole, [(late, late)])}
    tried |= {name: (kept, [(~mask, mask) for mask in own]) for name, own in splits.items() if own}
    for protocol, (table, parts) in tried.items():
        x, y = table.column(channel), table.column(PROXIMAL)
        lines = [fit_line(x[fitted], y[fitted]) for fitted, _ in parts]
        estimates = [line(x[scored]) for line, (_, scored) in zip(lines, parts, strict=True)]
        found = score(np.concatenate(estimates), np.concatenate([y[scored] for _, scored in parts]))
        offset, gain = lines[0].coef.tolist() if len(lines) == 1 else (None, None)
        yield Row(surrogate, protocol, len(table.names), gain, unit, offset, found)


def _rmse_by_run(table: ClosingTable, channel: str, masks: list[Mask]) -> dict[str, float]:
    x, y, estimate = table.column(channel), table.column(PROXIMAL), np.zeros(len(table.run))
    for mask in masks:
        estimate[mask] = fit_line(x[~mask], y[~mask])(x[mask])
    parts = {name: table.run == index for index, name in enumerate(table.names)}
    return {n: rmse(estimate[p], y[p]) for n, p in sorted(parts.items()) if p.any()}
