"""Runs in which a channel of an equation has the opposite sign of the other runs."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from estimation.campaign import Campaign
from estimation.errors import EstimationError
from estimation.fit_problem import Problem, prepared, problem_of, solve
from estimation.model import Model
from estimation.opposed import UNEXPLAINED, negated, signed
from estimation.recording import FloatArray

LITTLE = 0.1
"""Share of the square of a run's target that is not explained with the right sign, at most."""


def turned_runs(fitted: Model, campaign: Campaign) -> Iterator[str]:
    """Yield the channels that are minus one times what the other runs predict, with their runs.

    A run that the others do not predict spoils what these predict of one another. The one without
    which the others agree best is taken out first.
    """
    try:
        runs = _laid_out(fitted, campaign)
        out = list[str]()
        while len(out) < (len(runs.grams) - 1) // 2:
            far = [n for n in runs.grams if n not in out and runs.is_far(n, [*out, n])]
            if not far:
                break
            out.append(min(far, key=lambda name: runs.cost([*out, name])))
        if not out:
            return
        turned = {c: _laid_out(fitted, negated(campaign, c)) for c in signed(fitted, campaign)}
        weights = runs.weights(out)
    except EstimationError:
        return
    found: dict[str, list[str]] = {}
    for name in out:
        errors = {c: _error(turned[c].grams[name], weights) for c in turned}
        channel = min(errors, key=errors.__getitem__, default="")
        if channel and errors[channel] < LITTLE * runs.size(name):
            found.setdefault(channel, []).append(name)
    for channel, names in found.items():
        yield (
            f"{channel} is about -1 times what the other runs predict for it in"
            f" {', '.join(names)}; is its sign wrong there?"
        )


@dataclass(frozen=True)
class _Runs:
    """The cross-products of each run's columns and target, by its name, and of all runs."""

    problem: Problem
    grams: dict[str, FloatArray]
    total: FloatArray

    def weights(self, without: Collection[str]) -> FloatArray:
        """Return the amplitudes of a fit without some runs."""
        return solve(self.problem, self._sum(without))

    def cost(self, without: Collection[str]) -> float:
        """Return the squared error of a fit without some runs, on the others."""
        total = self._sum(without)
        return _error(total, solve(self.problem, total))

    def _sum(self, without: Collection[str]) -> FloatArray:
        """Return the cross-products of the runs that are not left out."""
        return self.total - sum(self.grams[name] for name in without)

    def size(self, name: str) -> float:
        """Return the square of a run's target."""
        return float(self.grams[name][-1, -1])

    def is_far(self, name: str, without: Collection[str]) -> bool:
        """Whether a fit without some runs does not predict a run."""
        error = _error(self.grams[name], self.weights(without))
        return error > UNEXPLAINED**2 * self.size(name)


def _laid_out(model: Model, campaign: Campaign) -> _Runs:
    """Return the cross-products of the runs with the shapes of a fitted model."""
    problem = problem_of(model, prepared(model, campaign))
    shape = [x for term in model.terms for x in term.numbers(term.effect.shape)]
    grams = {run.thin.name: problem.gram(run, shape) for run in problem.runs}
    return _Runs(problem, grams, np.sum([*grams.values()], axis=0))


def _error(gram: FloatArray, weights: FloatArray) -> float:
    vector = np.append(weights, -1.0)
    return float(vector @ gram @ vector)
