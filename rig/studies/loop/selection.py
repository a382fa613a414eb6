"""Effects added to a model one after another, for prediction: no name is claimed.

Each step adds the effect that lowers the squared error of training runs left out most. Shapes are
taken from a grid, then moved together with all others to the least squared error.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.campaign import Campaign
from estimation.effects import Effect
from estimation.fit_problem import FitError, FitRun, prepared
from estimation.fitting import fit
from estimation.model import Estimate, Model, Term
from estimation.recording import FloatArray

FLOOR = 0.002
"""Least share of the first model's squared error that an effect must remove."""

MOST_TOGETHER = 48
"""Grid points of an effect with several shape parameters at most."""

RIDGE = 1e-9
"""Added to every squared column, as a share of it: columns may be collinear on some runs."""


@dataclass(frozen=True)
class Chosen:
    """A model and what its last effect gained."""

    model: Model
    gain: float  # share of the squared error of the model before it, on training runs left out


def selected(
    declared: Model,
    campaign: Campaign,
    tried: Sequence[Term],
    parameters: int,
    on_found: Callable[[Chosen], None] = lambda _: None,
) -> list[Chosen]:
    """Return the declared model and, one after another, the models with one more effect.

    Each of the effects tried may be added any number of times, up to so many named parameters of
    the whole model. `on_found` is called with each model.
    """
    chosen = [Chosen(fit(declared, campaign, bootstrap=0), 0.0)]
    runs = prepared(replace(declared, terms=(*declared.terms, *tried)), campaign)
    first = None
    while True:
        model = chosen[-1].model
        room = parameters - sum(len(term.parameters) for term in model.terms)
        fitting = [term for term in tried if len(term.parameters) <= room]
        base = [
            np.hstack([t.sign * run.columns(t, t.numbers(t.effect.shape)) for t in model.terms])
            for run in runs
        ]
        aims = [run.thin[model.target] for run in runs]
        before = _left_out(_grams(base, aims))
        first = before if first is None else first
        best = min(_scored(base, aims, runs, fitting), key=lambda one: one[0], default=None)
        if best is None or before - best[0] < FLOOR * first:
            return chosen
        try:
            larger = replace(model, terms=(*model.terms, best[1]))
            fitted = fit(larger, campaign, bootstrap=0, shapes="near")
        except FitError:
            return chosen
        chosen.append(Chosen(fitted, 1.0 - best[0] / before))
        on_found(chosen[-1])


def grid(effect: Effect) -> list[tuple[float, ...]]:
    """Return the shapes of an effect that are tried."""
    points = [[float(x) for x in p.grid()] for p in effect.shape]
    if math.prod(map(len, points)) > MOST_TOGETHER and len(points) > 1:
        most = max(3, int(MOST_TOGETHER ** (1 / len(points))))
        points = [_spread(values, most) for values in points]
    return list(itertools.product(*points))


def _spread(values: list[float], most: int) -> list[float]:
    """Return at most so many of the values, evenly spread, without the outermost ones."""
    if len(values) <= most:
        return values
    return [values[round(p)] for p in np.linspace(0, len(values) - 1, most + 2)[1:-1]]


def _scored(
    base: Sequence[FloatArray],
    aims: Sequence[FloatArray],
    runs: Sequence[FitRun],
    tried: Sequence[Term],
) -> Iterator[tuple[float, Term]]:
    """Yield the squared error of runs left out with each effect at each shape of its grid."""
    for term in tried:
        amplitudes = {p.name: Estimate(0.0) for p in term.effect.amplitudes}
        for shape in grid(term.effect):
            columns = [term.sign * run.columns(term, shape) for run in runs]
            if not all(np.isfinite(c).all() and c.any() for c in columns):
                continue
            grams = _grams([np.hstack(pair) for pair in zip(base, columns, strict=True)], aims)
            bounds = term.effect.amplitudes
            fitted = _solved(grams.sum(axis=0))[-len(bounds) :]
            if not all(p.lower <= x <= p.upper for p, x in zip(bounds, fitted, strict=True)):
                continue  # its amplitudes, fitted with all others, are not physically meaningful
            values = {p.name: Estimate(x) for p, x in zip(term.effect.shape, shape, strict=True)}
            yield _left_out(grams), replace(term, values=amplitudes | values)


def _left_out(grams: FloatArray) -> float:
    """Return the squared error of each run under the fit on the others, summed."""
    whole, total = grams.sum(axis=0), 0.0
    for own in grams:
        vector = np.append(_solved(whole - own), -1.0)
        total += float(vector @ own @ vector)
    return total


def _grams(tables: Sequence[FloatArray], aims: Sequence[FloatArray]) -> FloatArray:
    """Return each run's products of columns and aim, shape (runs, columns + 1, columns + 1)."""
    both = [np.column_stack(pair) for pair in zip(tables, aims, strict=True)]
    return np.array([table.T @ table for table in both])


def _solved(gram: FloatArray) -> FloatArray:
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram)[:-1], np.finfo(float).tiny))
    normal = gram[:-1, :-1] * np.outer(scale, scale) + RIDGE * np.eye(len(scale))
    return np.asarray(np.linalg.solve(normal, gram[:-1, -1] * scale) * scale)
