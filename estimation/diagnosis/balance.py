"""One balance laid out for diagnosis: its runs, its target, its declared and its found effects."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import linalg, optimize

from estimation.diagnosis.candidate import Candidate, step
from estimation.diagnosis.design import Mapper, Run, tables, targets
from estimation.diagnosis.evidence import resampled
from estimation.diagnosis.least_squares import least_squares
from estimation.diagnosis.paths import path_of
from estimation.fitting import OFFSET, interval95
from estimation.model import Estimate, Model, Term
from estimation.recording import FloatArray
from estimation.within_bounds import solve_within

NUDGE = 0.02
"""Step of a numerical derivative by a shape, in steps of its grid."""


@dataclass(frozen=True)
class Balance:
    """A declared model on the runs that discover.

    Attributes:
        model: The declared model.
        runs: The runs.
        target: Thinned target of each run, shape (n,).
        terms: Declared effects at their fitted shapes, without the offset that runs replace.
        mapper: Maps work over runs.
        tables_of: Thinned columns of effects already worked out.
    """

    model: Model
    runs: Sequence[Run]
    target: Sequence[FloatArray]
    terms: Sequence[Candidate]
    mapper: Mapper = map
    tables_of: dict[Candidate, list[FloatArray]] = field(default_factory=dict)

    @property
    def demean(self) -> bool:
        """Whether each run's mean is a nuisance."""
        return self.model.run_offsets

    @property
    def one_path(self) -> bool:
        """Whether the runs are periods of one path."""
        return len(self.runs) > 1 and len({path_of(run.name) for run in self.runs}) == 1

    def columns(self, terms: Sequence[Candidate]) -> list[FloatArray]:
        """Return the columns of effects side by side, one array a run; kept for the next time."""
        for term in terms:
            if term not in self.tables_of:
                self.tables_of[term] = tables(self.runs, [term], self.demean)
        empty = [np.empty((len(y), 0)) for y in self.target]
        blocks = [empty, *(self.tables_of[term] for term in terms)]
        return [np.hstack(parts) for parts in zip(*blocks, strict=True)]

    def slopes(self, terms: Sequence[Candidate]) -> list[FloatArray]:
        """Return the derivative of the fit by each shape, one array a run.

        With these beside the columns, a linear fit moves the shapes too, to first order.
        """
        weights = self.solve(terms)
        parts: list[list[FloatArray]] = [[np.empty((len(y), 0))] for y in self.target]
        at = 0
        for term in terms:
            count = len(term.effect.amplitudes)
            own = weights[at : at + count]
            at += count
            for k in range(len(term.shape)):
                high, low = term.moved(k, NUDGE), term.moved(k, -NUDGE)
                ends = [tables(self.runs, [end], self.demean) for end in (high, low)]
                for part, up, down in zip(parts, *ends, strict=True):
                    part.append((((up - down) / (2 * NUDGE)) @ own)[:, None])
        return [np.hstack(part) for part in parts]

    def base(self, terms: Sequence[Candidate]) -> list[FloatArray]:
        """Return what is refitted with every candidate: columns and slopes."""
        pairs = zip(self.columns(terms), self.slopes(terms), strict=True)
        return [np.hstack(pair) for pair in pairs]

    def solve(self, terms: Sequence[Candidate]) -> FloatArray:
        """Return the amplitudes of effects within their bounds, over all runs."""
        columns = self.columns(terms)
        return bounded(terms, _gram(columns, self.target))

    def left(self, terms: Sequence[Candidate]) -> list[FloatArray]:
        """Return the residual of each run, shape (n,)."""
        weights = self.solve(terms)
        return [y - c @ weights for y, c in zip(self.target, self.columns(terms), strict=True)]

    def loss(self, terms: Sequence[Candidate]) -> float:
        """Return the squared error over all runs."""
        return float(sum(r @ r for r in self.left(terms)))

    def refined(
        self, terms: Sequence[Candidate], passes: int = 2, last: int | None = None
    ) -> list[Candidate]:
        """Return the effects with all shapes moved to where the joint fit is best.

        Args:
            terms: The effects.
            passes: How often, each time in smaller steps.
            last: Move only those of so many effects at the end, None for all.
        """
        best = list(terms)
        begin = 0 if last is None else len(best) - last
        for width in (1.0, 0.3, 0.1)[:passes]:
            for i in range(begin, len(best)):
                for k in range(len(best[i].shape)):
                    best[i] = self._along(best, i, k, width)
        return best

    def stepped(self, terms: Sequence[Candidate]) -> list[Candidate]:
        """Return the effects after one Gauss-Newton step of all shapes together.

        It is halved until the error falls; where it never does, they stay as they are. Shapes that
        lean on one another, as the place and width of a bump, settle so and not one by one.
        """
        places = [(i, k) for i, term in enumerate(terms) for k in range(len(term.shape))]
        if not places:
            return list(terms)
        base, left = np.vstack(self.base(terms)), np.concatenate(self.left(terms))
        steps = np.clip(least_squares(base, left)[-len(places) :], -1.0, 1.0)
        least = self.loss(terms)
        for share in 0.5 ** np.arange(6):
            moved = list(terms)
            for (i, k), one in zip(places, steps, strict=True):
                moved[i] = moved[i].moved(k, share * float(one))
            loss = self.loss(moved)
            if loss < least:
                return moved
            for term in moved:
                self.tables_of.pop(term, None)  # a point of a search, not to be kept
        return list(terms)

    def _along(self, terms: list[Candidate], i: int, k: int, width: float) -> Candidate:
        """Return effect i with its k-th shape at the best value near where it stands."""
        term = terms[i]

        def error(steps: float) -> float:
            moved = term.moved(k, steps)
            value = self.loss([*terms[:i], moved, *terms[i + 1 :]])
            if moved != term:
                self.tables_of.pop(moved, None)  # a point of a search, not to be kept
            return value

        found = optimize.minimize_scalar(
            error, bounds=(-width, width), method="bounded", options={"xatol": 0.02 * width}
        )
        return term.moved(k, found.x) if found.fun < error(0.0) else term


def lay_out(fitted: Model, runs: Sequence[Run], mapper: Mapper = map) -> Balance:
    """Lay out a fitted model on its runs."""
    terms = [
        Candidate.of(t, t.numbers(t.effect.shape))
        for t in fitted.terms
        if not (fitted.run_offsets and t.effect.id == OFFSET)
    ]
    return Balance(fitted, runs, targets(runs, fitted), terms, mapper)


def bounded(terms: Sequence[Candidate], gram: FloatArray) -> FloatArray:
    """Solve a Gram matrix of columns and target for amplitudes within the effects' bounds."""
    parameters = [p for term in terms for p in term.effect.amplitudes]
    if not parameters:
        return np.empty(0)
    scale = np.sqrt(np.maximum(np.diag(gram)[:-1], np.finfo(float).tiny))
    normal = gram[:-1, :-1] / np.outer(scale, scale) + 1e-10 * np.eye(len(scale))
    root = linalg.cholesky(normal)
    right = linalg.solve_triangular(root, gram[:-1, -1] / scale, trans="T")
    free: FloatArray = linalg.solve_triangular(root, right) / scale
    low = np.array([p.lower for p in parameters])
    high = np.array([p.upper for p in parameters])
    if np.all(free >= low) and np.all(free <= high):
        return free
    result = optimize.lsq_linear(root, right, (low * scale, high * scale), method="bvls")
    inside: FloatArray = result.x / scale
    return inside


def intervals(
    balance: Balance, terms: Sequence[Candidate], seed: int, count: int = 500
) -> list[dict[str, Estimate]]:
    """Return every effect's parameters with 95 % intervals of a bootstrap over runs.

    Each replicate takes one Gauss-Newton step from the fit in amplitudes and shapes together, and
    keeps the amplitudes within their bounds: a bound that is active in the fit would else shift the
    other parameters of every replicate.
    """
    weights = balance.solve(terms)
    amplitudes = [p for term in terms for p in term.effect.amplitudes]
    tables_ = zip(balance.base(terms), balance.left(terms), strict=True)
    products = [np.column_stack(pair).T @ np.column_stack(pair) for pair in tables_]
    moved = np.full((count, len(products[0]) - 1), np.nan)
    low, high = np.full(moved.shape[1], -np.inf), np.full(moved.shape[1], np.inf)
    low[: len(weights)] = [p.lower for p in amplitudes] - weights
    high[: len(weights)] = [p.upper for p in amplitudes] - weights
    for row, weight in enumerate(resampled(len(products), count, seed)):
        total = np.tensordot(weight, products, axes=1)
        moved[row] = solve_within(total[:-1, :-1], total[:-1, -1], low, high)
    values: list[dict[str, Estimate]] = []
    linear, at = len(weights), 0
    place = linear
    for term in terms:
        own: dict[str, Estimate] = {}
        for parameter in term.effect.amplitudes:
            own[parameter.name] = _estimate(float(weights[at]), weights[at] + moved[:, at])
            at += 1
        for parameter, value in zip(term.effect.shape, term.shape, strict=True):
            steps = np.clip(moved[:, place], -5, 5)
            own[parameter.name] = _estimate(
                value, np.array([step(parameter, value, float(x)) for x in steps])
            )
            place += 1
        values.append(own)
    return values


def as_model(
    balance: Balance, terms: Sequence[Candidate], values: Sequence[Mapping[str, Estimate]]
) -> Model:
    """Return the declared model with the found effects added and every parameter's value.

    Where run offsets replaced the model's own offset, that is the mean over the runs of what the
    others leave.
    """
    made = [replace(t.term, values=v) for t, v in zip(terms, values, strict=True)]
    if balance.demean and any(t.effect.id == OFFSET for t in balance.model.terms):
        weights = balance.solve(terms)
        levels = []
        for run in balance.runs:
            columns = np.column_stack([t.columns(run.channels) for t in terms])
            error = run.channels[balance.model.target] - columns @ weights
            levels.append(float(error[run.used].mean()))
        offset = next(t for t in balance.model.terms if t.effect.id == OFFSET)
        level = Estimate(float(np.mean(levels)) * offset.sign)
        made.append(Term(offset.effect, offset.sign, dict(offset.channels), {"offset": level}))
    return replace(balance.model, terms=tuple(made), evidence=None)


def _estimate(value: float, replicates: FloatArray) -> Estimate:
    return Estimate(value, float(replicates.std(ddof=1)), interval95(value, replicates))


def _gram(columns: Sequence[FloatArray], target: Sequence[FloatArray]) -> FloatArray:
    joined = [np.column_stack(pair) for pair in zip(columns, target, strict=True)]
    total: FloatArray = np.sum([part.T @ part for part in joined], axis=0)
    return total
