"""A model frozen after discovery, and its errors on runs that it has not seen."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.design import Run
from estimation.diagnosis.evidence import resampled
from estimation.diagnosis.maps import RIDGE, Map
from estimation.diagnosis.result import Error
from estimation.diagnosis.turning import turned
from estimation.recording import FloatArray
from estimation.within_bounds import solve_within

ROUNDS = 30
SETTLED = 1e-5
"""Shapes are settled when a round lowers the squared error by less than this share of it."""


@dataclass(frozen=True)
class Part:
    """What one finding adds: an effect, a map, or the terms of a formula in place of a map."""

    candidate: Candidate | None = None
    map: Map | None = None
    formula: tuple[Candidate, ...] = ()

    @property
    def terms(self) -> tuple[Candidate, ...]:
        """The effects among it."""
        return self.formula if self.candidate is None else (self.candidate, *self.formula)


@dataclass(frozen=True)
class Frozen:
    """Effects and maps with their weights; nothing of it changes any more.

    Attributes:
        balance: The balance it was fitted on.
        terms: Declared effects, then found ones.
        maps: Maps beside them.
        weights: Amplitudes of the effects, then of the maps' columns.
        level: Mean over the discovery runs of what they leave.
    """

    balance: Balance
    terms: tuple[Candidate, ...]
    maps: tuple[Map, ...]
    weights: FloatArray
    level: float

    def error(self, run: Run, at_rest: bool = False) -> FloatArray:
        """Return target less estimate at the run's used samples, or all valid ones, shape (n,)."""
        parts = [term.columns(run.channels) for term in self.terms]
        parts += [m.columns(run) for m in self.maps]
        target = run.channels[self.balance.model.target]
        values = target - np.column_stack(parts) @ self.weights - self.level
        return np.asarray(values[run.valid if at_rest else run.used])


def freeze(balance: Balance, parts: Sequence[Part]) -> Frozen:
    """Fit declared effects and parts together on the discovery runs."""
    terms = [*balance.terms, *(term for part in parts for term in part.terms)]
    terms = turned(balance, terms)
    maps = [p.map for p in parts if p.map is not None]
    weights = balance.solve(terms) if not maps else _with_maps(balance, terms, maps)
    level = 0.0
    frozen = Frozen(balance, tuple(terms), tuple(maps), weights, level)
    if balance.demean:
        level = float(np.mean([frozen.error(run).mean() for run in balance.runs]))
    return replace(frozen, level=level)


def settled(balance: Balance, parts: Sequence[Part]) -> Frozen:
    """Fit declared effects and the parts' effects together, amplitudes and shapes, and freeze.

    Args:
        balance: The balance on the runs that discover.
        parts: Effects and formulas; a map has no shape to settle.
    """
    terms = [*balance.terms, *(term for part in parts for term in part.terms)]
    terms = balance.refined(terms, passes=3)
    for _ in range(ROUNDS):
        before = balance.loss(terms)
        terms = balance.stepped(terms)
        if before - balance.loss(terms) < SETTLED * before:
            break
    declared = len(balance.terms)
    moved = replace(balance, terms=terms[:declared])
    return freeze(moved, [Part(formula=tuple(terms[declared:]))])


def _with_maps(balance: Balance, terms: Sequence[Candidate], maps: Sequence[Map]) -> FloatArray:
    rows = []
    for run, columns in zip(balance.runs, balance.columns(terms), strict=True):
        thin = [run.thin(m.columns(run)) for m in maps]
        flat = [t - t.mean(axis=0) if balance.demean else t for t in thin]
        rows.append(np.hstack([columns, *flat]))
    whole, aim = np.vstack(rows), np.concatenate(balance.target)
    squared = np.maximum(np.einsum("nk,nk->k", whole, whole), np.finfo(float).tiny)
    own = balance.columns(terms)[0].shape[1]
    pull = squared * np.concatenate([np.full(own, 1e-9), np.full(len(squared) - own, RIDGE)])
    low, high = np.full(len(squared), -np.inf), np.full(len(squared), np.inf)
    amplitudes = [p for term in terms for p in term.effect.amplitudes]
    low[:own], high[:own] = [p.lower for p in amplitudes], [p.upper for p in amplitudes]
    return solve_within(whole.T @ whole + np.diag(pull), whole.T @ aim, low, high)


def squares(frozen: Frozen, runs: Sequence[Run], at_rest: bool = False) -> FloatArray:
    """Return each run's sum of squared errors, its mean removed, shape (runs,).

    Args:
        frozen: The model.
        runs: The runs.
        at_rest: Count samples at rest too, as reported errors do; what is claimed is decided
            without them.
    """
    errors = [frozen.error(run, at_rest) for run in runs]
    return np.array([float(np.sum((e - e.mean()) ** 2)) for e in errors])


def samples_of(runs: Sequence[Run]) -> FloatArray:
    """Return how many samples each run's reported error is over, shape (runs,)."""
    return np.array([float(run.valid.sum()) for run in runs])


def errors(before: Frozen, after: Frozen, runs: Sequence[Run], seed: int) -> Error:
    """Open the confirm runs: errors of the declared model and of the one with the findings.

    They are over all valid samples, those at rest too, before and after alike.
    """
    samples = samples_of(runs)
    first, last = squares(before, runs, at_rest=True), squares(after, runs, at_rest=True)
    weights = resampled(len(runs), 1000, seed)
    ratio = np.sqrt((weights @ last) / np.maximum(weights @ first, np.finfo(float).tiny))
    low, high = np.percentile(ratio, [2.5, 97.5])
    raw = [
        float(np.sqrt(sum(float(e @ e) for e in (f.error(r, True) for r in runs)) / samples.sum()))
        for f in (before, after)
    ]
    names = [run.name for run in runs]
    return Error(
        before=float(np.sqrt(first.sum() / samples.sum())),
        after=float(np.sqrt(last.sum() / samples.sum())),
        with_means_before=raw[0],
        with_means_after=raw[1],
        ratio_ci95=(float(low), float(high)),
        by_run_before=dict(zip(names, np.sqrt(first / samples).tolist(), strict=True)),
        by_run_after=dict(zip(names, np.sqrt(last / samples).tolist(), strict=True)),
    )
