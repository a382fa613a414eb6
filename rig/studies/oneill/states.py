"""Estimates from physical states on the data of O'Neill et al. 2018, on runs that were not fitted.

Every row is of whole runs held out: in five folds, or all runs of one frequency or power level. The
five folds are those of the network rows, so that both stand side by side.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation.bank.states import EFFECTS, Bank
from estimation.campaign import Campaign
from estimation.closing import is_closing, processed
from estimation.estimator import rows_of
from estimation.estimators.bank import EVERY, BankEstimator, Estimates, fit_runs
from estimation.estimators.run_evidence import RunEvidence
from estimation.live_channels import causal_channels
from estimation.recording import FloatArray, Recording
from rig.studies.oneill.data import held_out_runs, pose_runs
from rig.studies.oneill.paper import CONDITIONS, DISTAL, FILTERS, JAW, POSES, PROXIMAL, TARGETS
from rig.studies.oneill.state_rows import LOADS, StateJob, StateRow, scored
from rig.studies.oneill.study import fit_line

DRAWN = (Bank(LOADS["command"]), "live")
"""Content of the figures."""


@dataclass(frozen=True)
class StateStudy:
    """Results."""

    schema: str
    rows: tuple[StateRow, ...]
    weights: int  # number of weights of the neutral pose's estimator
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Shown:
    """Estimates of one target on the closing samples of a run held out, in its SI unit."""

    name: str
    time_s: FloatArray
    rows: FloatArray  # filtered channels of the bank, shape (n, channels)
    truth: FloatArray  # the target without lag, shape (n,)
    # estimate by a straight line through the surrogate, as in Table I of the paper
    before: FloatArray
    after: FloatArray  # estimate by physical states, fitted on the same runs


@dataclass(frozen=True, eq=False)
class _Run:
    """A run's closing samples: rows of channels by surrogate's channel and filters, the truth."""

    name: str
    time_s: FloatArray
    rows: Mapping[tuple[str, str], FloatArray]
    truth: Mapping[str, FloatArray]
    valid: np.ndarray
    conditions: Mapping[str, float | str]


def jobs(poses: Sequence[str]) -> list[StateJob]:
    """Return the rows of the study."""
    surrogates, protocols = ("command", "current"), ("run-wise", "lofo", "lopo")
    neutral = product(surrogates, FILTERS, protocols, TARGETS)
    posed = product(("pitch", "roll"), surrogates, FILTERS, ("run-wise", "lopo"), (DISTAL, JAW))
    planned = [
        *(StateJob("neutral", s, target, filters, held) for s, filters, held, target in neutral),
        *(StateJob("neutral", "sensor", target) for target in (DISTAL, JAW)),
        *(StateJob("neutral", "command", t, without=e) for e, t in product(EFFECTS, TARGETS)),
        *(StateJob(pose, s, target, filters, held) for pose, s, filters, held, target in posed),
    ]
    return [job for job in planned if job.pose in poses]


def run_states(
    neutral: Campaign,
    folder: Path | None,
    *,
    seed: int = 0,
    on_row: Callable[[int, int], None] = lambda done, total: None,
    on_shown: Callable[[str, list[Shown]], None] | None = None,
) -> StateStudy:
    """Fit and score all rows; the folder is as of `pose_runs`.

    `on_shown` is called with a target and what its figures are drawn from, made only for it.

    Raises:
        MissingChannelError: A run lacks a channel.
    """
    campaigns = {"neutral": neutral}
    for pose in ("pitch", "roll"):
        found = pose_runs(folder, pose)
        if found is not None:
            campaigns[pose] = found
    planned = jobs(tuple(campaigns))
    rows: list[StateRow] = []
    for pose, campaign in campaigns.items():  # one at a time: a pose fills memory
        own = [job for job in planned if job.pose == pose]
        wanted = list(dict.fromkeys((job.surrogate, job.filters) for job in own))
        runs = []
        for recording in campaign.evidence:
            run = _reduced(recording, POSES[pose], wanted)
            runs += [run] if run.valid.any() else []
        for kind, alike in groupby(own, key=lambda job: (job.bank, job.filters)):
            evidence = _evidence(kind, runs)
            rows += _rows(list(alike), runs, evidence, seed)
            on_row(len(rows), len(planned))
            if on_shown is not None and kind == DRAWN:
                for target in (PROXIMAL, DISTAL):
                    on_shown(target, _shown(kind, target, runs, evidence[target], seed))
    return StateStudy(
        "rig.study.oneill-states/1",
        tuple(rows),
        Bank().size,
        tuple(f"No data of experiment 3, {p}." for p in POSES if p not in campaigns),
    )


def _reduced(recording: Recording, pose: str, wanted: list[tuple[str, str]]) -> _Run:
    if pose:
        angle = float(recording.conditions[pose])
        recording = recording.with_columns(**{pose: np.full(len(recording), angle)})
    banks = {surrogate: Bank(LOADS[surrogate], pose) for surrogate, _ in wanted}
    names = [*TARGETS, *(c for bank in banks.values() for c in bank.channels)]
    run = processed(recording, names)
    sources = {"zero-phase": run}
    if any(filters == "live" for _, filters in wanted):
        sources["live"] = causal_channels(recording, names, tracked=True)
    kept = is_closing(run)
    return _Run(
        recording.name,
        run.time_s[kept],
        {
            (LOADS[surrogate], filters): rows_of(sources[filters], banks[surrogate].channels)[kept]
            for surrogate, filters in wanted
        },
        {target: run[target][kept] for target in TARGETS},
        run.valid[kept],
        dict(recording.conditions),
    )


def _splits(runs: Sequence[_Run], protocol: str, seed: int) -> list[NDArray[np.intp]]:
    stated = {
        name: np.array([float(run.conditions.get(name, np.nan)) for run in runs])
        for name in CONDITIONS.values()
    }
    return held_out_runs(stated, protocol, seed)


def _evidence(kind: tuple[Bank, str], runs: Sequence[_Run]) -> dict[str, list[RunEvidence]]:
    """Return the runs of the fit by target; runs without valid closing samples are excluded."""
    bank, filters = kind
    found: dict[str, list[RunEvidence]] = {target: [] for target in TARGETS}
    for run in runs:
        kept = np.flatnonzero(run.valid)[::EVERY]
        truths = np.column_stack([run.truth[target][kept] for target in TARGETS])
        rows = run.rows[bank.surrogate, filters][kept]
        reduced = RunEvidence.of_rows(bank, rows, truths, run.conditions)
        for target, evidence in zip(TARGETS, reduced, strict=True):
            found[target].append(evidence)
    return found


def _shown(
    kind: tuple[Bank, str],
    target: str,
    runs: Sequence[_Run],
    evidence: Sequence[RunEvidence],
    seed: int,
) -> list[Shown]:
    """Estimate each run by fits without it."""
    bank, filters = kind
    load = bank.channels.index(bank.surrogate)
    rows = [run.rows[bank.surrogate, filters] for run in runs]
    found: dict[int, Shown] = {}
    for held_out in _splits(runs, "run-wise", seed):
        rest = [k for k in range(len(runs)) if k not in held_out]
        line = fit_line(
            np.concatenate([rows[k][:, load] for k in rest]),
            np.concatenate([runs[k].truth[target] for k in rest]),
        )
        estimator = fit_runs([evidence[k] for k in rest], bank, target)
        for k in map(int, held_out):
            before, after = line(rows[k][:, load]), estimator.of_rows(rows[k]).value
            run = runs[k]
            found[k] = Shown(run.name, run.time_s, rows[k], run.truth[target], before, after)
    return [found[k] for k in sorted(found)]


def _rows(
    alike: Sequence[StateJob],
    runs: Sequence[_Run],
    evidence: Mapping[str, Sequence[RunEvidence]],
    seed: int,
) -> list[StateRow]:
    """Fit and score jobs of one bank and one filter, so that each run's design is made once."""
    bank, filters = alike[0].bank, alike[0].filters
    fitted = {job: _fitted(job, evidence[job.target], runs, seed) for job in alike}
    estimates: dict[StateJob, list[Estimates]] = {job: [] for job in alike if fitted[job]}
    for k, run in enumerate(runs):
        rows = run.rows[bank.surrogate, filters]
        design = bank.design(rows)
        for job, found in estimates.items():
            found.append(fitted[job][k].of_design(design, rows))
    conditions = [run.conditions for run in runs]
    return [
        scored(job, found, [run.truth[job.target] for run in runs], conditions)
        for job, found in estimates.items()
    ]


def _fitted(
    job: StateJob, evidence: Sequence[RunEvidence], runs: Sequence[_Run], seed: int
) -> dict[int, BankEstimator]:
    """Return the estimator that was fitted without each run; none where it cannot be done."""
    found: dict[int, BankEstimator] = {}
    for held_out in _splits(runs, job.protocol, seed):
        rest = [run for k, run in enumerate(evidence) if k not in held_out]
        found |= dict.fromkeys(map(int, held_out), fit_runs(rest, job.bank, job.target))
    return found
