"""What an estimate from physical states is scored by, on runs that were not fitted.

The run is the unit: the spread of a share of samples is that over resampled runs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.bank.states import Bank
from estimation.estimators.bank import Estimates
from estimation.recording import FloatArray
from estimation.scores import Score, score
from rig.studies.oneill.paper import CONDITIONS, POSES, PROXIMAL, SURROGATES

LOADS = {**SURROGATES, "sensor": PROXIMAL}

RESAMPLED = 2000
"""Campaigns resampled from the runs, for the standard error of a share."""


@dataclass(frozen=True)
class StateJob:
    """One estimator under one protocol."""

    pose: str  # key of `POSES`
    surrogate: str  # key of `LOADS`
    target: str
    filters: str = "zero-phase"  # `zero-phase`, or `live` for inputs filtered causally
    protocol: str = "run-wise"  # `run-wise`, `lofo` or `lopo`
    without: str = ""  # effect left out, a key of `EFFECTS`, or empty

    @property
    def bank(self) -> Bank:
        """What is fitted."""
        without = (self.without,) if self.without else ()
        return Bank(LOADS[self.surrogate], POSES[self.pose], without)


@dataclass(frozen=True)
class Level:
    """One frequency or power level that was left out."""

    value: float
    samples: int
    rmse: float
    covered: float  # share of them inside their interval


@dataclass(frozen=True)
class StateRow:
    """Error of one job, in the target's SI unit."""

    job: StateJob
    runs: int
    score: Score  # errors over all closing samples of the held-out runs
    run_offset: float  # root mean square of the runs' mean errors
    covered: float  # share of the samples inside their interval
    # between what 95 % of that share lies if other runs like these had come
    covered_between: tuple[float, float]
    covered_median: float  # median of that share over runs
    covered_worst: float  # smallest share of a run
    inside: float  # share of the samples inside the range that was fitted
    rmse_inside: float  # error over these samples; NaN where there are none
    # what was left out in turn, ascending; empty where it was folds of runs
    levels: tuple[Level, ...]


def scored(
    job: StateJob,
    estimates: Sequence[Estimates],
    truths: Sequence[FloatArray],
    conditions: Sequence[Mapping[str, float | str]],
) -> StateRow:
    """Score the estimates of runs held out; estimates, truths and conditions are one a run."""
    errors = [e.value - truth for e, truth in zip(estimates, truths, strict=True)]
    covered = [np.abs(e) <= own.half_width for own, e in zip(estimates, errors, strict=True)]
    inside = np.concatenate([own.inside for own in estimates])
    shares = [float(np.mean(part)) for part in covered]
    whole = np.concatenate(errors)
    return StateRow(
        job=job,
        runs=len(truths),
        score=score(np.concatenate([own.value for own in estimates]), np.concatenate(truths)),
        run_offset=float(np.sqrt(np.mean([e.mean() ** 2 for e in errors]))),
        covered=float(np.mean(np.concatenate(covered))),
        covered_between=_between(covered),
        covered_median=float(np.median(shares)),
        covered_worst=min(shares),
        inside=float(inside.mean()),
        rmse_inside=float(np.sqrt(np.mean(whole[inside] ** 2))) if inside.any() else float("nan"),
        levels=_levels(job, errors, covered, conditions),
    )


def _between(covered: Sequence[np.ndarray]) -> tuple[float, float]:
    """Return the 95 % interval of a share of samples, by a bootstrap of runs."""
    counts = np.array([len(part) for part in covered])
    inside = np.array([part.sum() for part in covered])
    drawn = np.random.default_rng(0).integers(len(counts), size=(RESAMPLED, len(counts)))
    shares = inside[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    low, high = np.quantile(shares, [0.025, 0.975])
    return float(low), float(high)


def _levels(
    job: StateJob,
    errors: Sequence[FloatArray],
    covered: Sequence[np.ndarray],
    conditions: Sequence[Mapping[str, float | str]],
) -> tuple[Level, ...]:
    if job.protocol not in CONDITIONS:
        return ()
    values = np.array([float(stated[CONDITIONS[job.protocol]]) for stated in conditions])
    found = []
    for value in np.unique(values):
        own = np.flatnonzero(values == value).tolist()
        error = np.concatenate([errors[k] for k in own])
        share = float(np.mean(np.concatenate([covered[k] for k in own])))
        found.append(Level(float(value), len(error), float(np.sqrt(np.mean(error**2))), share))
    return tuple(found)


def ablated(rows: Sequence[StateRow], target: str) -> dict[str, StateRow]:
    """Return the ablation's rows of a target by the effect left out; the whole one under ''."""
    whole = StateJob("neutral", "command", target)
    return {r.job.without: r for r in rows if replace(r.job, without="") == whole}
