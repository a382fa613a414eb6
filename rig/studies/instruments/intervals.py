"""How often the intervals of state estimators hold, where they were not fitted."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation.bank.interval import covered_share
from estimation.bank.states import Bank
from estimation.campaign import Campaign, in_folds
from estimation.closing import is_closing, processed
from estimation.estimator import rows_of
from estimation.estimators.adaptation import adapted_states, spread_out
from estimation.estimators.bank import EVERY, BankEstimator, fit_runs
from estimation.estimators.run_evidence import RunEvidence
from rig.importers.jaw_steps import JAW, with_one_zero
from rig.output.provenance import Provenance
from rig.studies.oneill.paper import CONDITIONS, FOLDS, TARGETS

BANK = Bank("motor_current_a")
INSTRUMENTS = (
    *("Tool_4_Maryland_L_4", "Tool_4_Maryland_L_2", "Tool_5_Maryland_L_2"),
    *(f"Tool_4_Maryland_L_{pose}_{k}" for pose in ("Pitch", "Roll") for k in range(1, 6)),
)
"""Every instrument and pose of the public data."""
CHOSEN_ON = tuple(
    f"Tool_4_Maryland_L_{pose}" for pose in ("Pitch_1", "Pitch_3", "Roll_1", "Roll_3")
)
"""Those on which it was chosen where an interval ends and how far one run may change another angle;
no sentence counts them."""
LEVELS = {**CONDITIONS, "stop": "jaw_stop_index"}
COUNTS = (1, 3)
"""Runs adapted with."""


@dataclass(frozen=True)
class Held:
    """The interval on runs that were not fitted, each run alike, in the target's SI unit."""

    instrument: str  # whose runs; of an adapted estimator `source -> other`
    target: str
    # `run`, `between` or `edge` of the levels of a condition, or the runs adapted with
    left_out: str
    runs: int  # runs held out; a run counts for each condition whose level was left out
    rmse: float
    covered: float  # mean over runs of the share of samples inside their interval
    median: float  # median over runs of that share
    worst_run: float  # smallest share of a run
    worst_level: float  # smallest mean share of one fit
    half_width: float
    no_width: float  # share of the samples for which none is stated
    spread: float  # standard error of `covered` over runs
    # adapted: the error over the median of every other choice of as many runs
    rmse_ratio: float = float("nan")
    worst_ratio: float = float("nan")  # adapted: the worst of these choices over their median


@dataclass(frozen=True)
class IntervalStudy:
    """Results."""

    schema: str
    levels: tuple[Held, ...]
    adapted: tuple[Held, ...]
    provenance: Provenance


def run_intervals(
    campaigns: Mapping[str, Campaign],
    sources: Sequence[str],
    seed: int = 0,
    on_step: Callable[[str], None] = lambda what: None,
) -> IntervalStudy:
    """Hold the intervals against runs that were not fitted.

    Runs with flagged closing samples are left out. The estimators of each source are adapted to
    every other instrument. `on_step` is called with what is done next.

    Raises:
        MissingChannelError: A run lacks a channel.
    """
    evidence = {}
    for name, campaign in campaigns.items():
        on_step(f"reads {name}")
        evidence[name] = _reduced(campaign)
    levels: list[Held] = []
    moved: list[Held] = []
    for name, by_target in evidence.items():
        for target, runs in by_target.items():
            on_step(f"{name}, {target}")
            levels += _left_out(name, target, runs, seed)
            if name not in sources:
                continue
            source = fit_runs(runs, BANK, target)
            for other, others in evidence.items():
                if other != name:
                    label = f"{name} -> {other}"
                    moved += [_adapted(label, source, others[target], n) for n in COUNTS]
    return IntervalStudy("rig.study.intervals/1", tuple(levels), tuple(moved), Provenance.now(seed))


def _reduced(campaign: Campaign) -> dict[str, list[RunEvidence]]:
    whole, _ = with_one_zero(campaign, JAW)
    found: dict[str, list[RunEvidence]] = {target: [] for target in TARGETS}
    for recording in whole.evidence:
        run = processed(recording, [*BANK.channels, *TARGETS])
        closing = is_closing(run)
        if (closing & ~run.valid).any() or not closing.any():
            continue
        kept = np.flatnonzero(closing)[::EVERY]
        rows, truths = (rows_of(run, names)[kept] for names in (BANK.channels, TARGETS))
        parts = RunEvidence.of_rows(BANK, rows, truths, recording.conditions)
        for target, part in zip(TARGETS, parts, strict=True):
            found[target].append(part)
    return found


def _splits(runs: Sequence[RunEvidence], seed: int) -> Iterator[tuple[str, NDArray[np.int_]]]:
    """Yield what is left out and its runs."""
    for fold in in_folds(len(runs), FOLDS, seed):
        yield "run", fold
    for condition in LEVELS.values():
        values = np.array([float(run.conditions.get(condition, 0.0)) for run in runs])
        levels = np.unique(values)
        for level in levels if len(levels) > 1 else []:
            edge = level in (levels[0], levels[-1])
            yield "edge" if edge else "between", np.flatnonzero(values == level)


def _left_out(name: str, target: str, runs: Sequence[RunEvidence], seed: int) -> list[Held]:
    found: dict[str, list[list[_Run]]] = {}
    for kind, at in _splits(runs, seed):
        fitted = fit_runs([runs[k] for k in range(len(runs)) if k not in at], BANK, target)
        found.setdefault(kind, []).append([_on_run(fitted, runs[k]) for k in at])
    return [_held(name, target, kind, parts) for kind, parts in found.items()]


def _adapted(label: str, source: BankEstimator, runs: Sequence[RunEvidence], count: int) -> Held:
    """Adapt with the runs that the rule takes, and compare with other choices of as many."""
    draw = np.random.default_rng(0)
    at_random = [draw.choice(len(runs), count, replace=False) for _ in range(len(runs))]
    choices = [np.array([k]) for k in range(len(runs))] if count == 1 else at_random
    scored = []
    for choice in [np.array(spread_out(runs, count)), *choices]:
        new = adapted_states(source, [runs[k] for k in choice])
        scored.append([_on_run(new, run) for k, run in enumerate(runs) if k not in choice])
    errors = [np.sqrt(np.mean([run.square for run in part])) for part in scored]
    usual = np.median(errors[1:])
    left_out = f"{count} run{'s' if count > 1 else ''}"
    held = _held(label, source.target, left_out, scored[:1])
    return replace(held, rmse_ratio=errors[0] / usual, worst_ratio=max(errors[1:]) / usual)


@dataclass(frozen=True)
class _Run:
    square: float
    covered: float | None
    half_width: float
    no_width: float


def _on_run(fitted: BankEstimator, run: RunEvidence) -> _Run:
    found = fitted.at(run.conditions).of_design(run.design, run.rows)
    error, width = found.value - run.truth, found.half_width
    stated = np.isfinite(width)
    return _Run(
        float(np.mean(error**2)),
        covered_share(error, width),
        float(width[stated].mean()) if stated.any() else float("nan"),
        float(1.0 - stated.mean()),
    )


def _held(name: str, target: str, left_out: str, fits: Sequence[Sequence[_Run]]) -> Held:
    runs = [run for part in fits for run in part]
    by_fit = [[run.covered for run in part if run.covered is not None] for part in fits]
    shares = [share for part in by_fit for share in part] or [np.nan]
    return Held(
        name,
        target,
        left_out,
        len(runs),
        float(np.sqrt(np.mean([run.square for run in runs]))),
        float(np.mean(shares)),
        float(np.median(shares)),
        min(shares),
        min((float(np.mean(part)) for part in by_fit if part), default=np.nan),
        float(np.mean([run.half_width for run in runs if run.covered is not None] or [np.nan])),
        float(np.mean([run.no_width for run in runs])),
        float(np.std(shares) / np.sqrt(max(len(shares) - 1, 1))),
    )
