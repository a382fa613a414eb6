"""One equation refitted with the causes that were found, and its errors on the test runs.

The search reads signals predicted from other sensors. Here every channel is read as measured, as a
model in use reads it, and the amplitudes are least squares within their bounds on the training
runs. Shapes of causes were found on a grid and those of declared terms without the causes: they
move next to one another. Fits and errors count the samples that the model counts: at
standstill friction takes any value.
"""

import itertools
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from estimation.campaign import Campaign
from estimation.causes import shapes
from estimation.causes.addition import Addition
from estimation.causes.numbers import DEFAULT, Numbers
from estimation.causes.run_errors import Errors
from estimation.derived import settled_places
from estimation.fit_problem import OFFSET, FitError, FitRun, one_constant, prepared
from estimation.fitting import fit
from estimation.model import Estimate, Model, Term
from estimation.predicted import with_prediction, without_unused
from estimation.recording import FloatArray, Recording
from estimation.within_bounds import solve_apart

MOVES = 4
"""Turns of moving the shapes."""

DRAWS = 200
"""Campaigns drawn for the spreads of a written model."""


@dataclass(frozen=True)
class Solved:
    """An equation with causes on the training runs.

    Attributes:
        parts: The causes, with the shapes of the least error next to one another.
        declared: The declared terms, at these shapes too.
        weights: Amplitudes, declared ones first.
        level: Mean residual over the runs.
        squared: Sum of squared residuals.
    """

    parts: tuple[Addition, ...]
    declared: tuple[Term, ...]
    weights: FloatArray
    level: float
    squared: float


class Refit:
    """One equation, fitted on the training runs, on all runs, which have the campaign's time.

    The numbers hold the prior of amplitudes without a term. Noisy channels take no part in the
    prediction of the target.

    Raises:
        FitError: No training run has a sample of the equation.
    """

    def __init__(
        self,
        model: Model,
        recordings: Sequence[Recording],
        train: Sequence[str],
        test: Sequence[str],
        numbers: Numbers = DEFAULT,
        noisy: Collection[str] = (),
    ) -> None:
        self.noisy = frozenset(noisy)
        self.model = with_prediction(model, noisy) if noisy else model
        self.recordings = {r.name: r for r in recordings}
        self.train_names, self.test_names = tuple(train), tuple(test)
        self.numbers = numbers
        self._runs: dict[frozenset[str], dict[str, tuple[FitRun, NDArray[np.intp]] | None]] = {}
        # with the causes themselves: the identity of one that is gone may be another's
        self._solved: dict[tuple[int, ...], tuple[Sequence[Addition], Solved]] = {}

    @cached_property
    def _declared(self) -> list[Term]:
        own = self.model.terms
        return [t for t in own if not (self.model.run_offsets and t.effect.id == OFFSET)]

    def solve(self, parts: Sequence[Addition]) -> Solved:
        """Return the amplitudes of the declared terms and of some causes on the training runs."""
        key = tuple(map(id, parts))
        if key not in self._solved:
            self._solved[key] = tuple(parts), self._fitted(tuple(parts))
        return self._solved[key][1]

    def amplitudes(self, part: Addition, parts: Sequence[Addition]) -> FloatArray:
        """Return the amplitudes of one of some causes."""
        in_order = sorted(parts, key=lambda p: p.term is None)  # that of their columns
        widths = [self._width(p) for p in in_order]
        after = sum(widths[in_order.index(part) :])
        weights = self.solve(parts).weights
        return weights[len(weights) - after :][: self._width(part)]

    def residuals(
        self, solved: Solved, name: str
    ) -> tuple[NDArray[np.intp], FloatArray, FloatArray] | None:
        """Return the samples that a run's error counts, and the target and the residual there.

        Shape (n,) each; None where the run has no sample of this equation.
        """
        known = self._run(solved.parts, name)
        if known is None:
            return None
        run, judged = known
        target = run.whole[self.model.target][judged]
        table = _table(solved.parts, solved.declared, run, judged)
        return judged, target, target - table @ solved.weights - solved.level

    def errors(self, solved: Solved, without: Collection[str] = ()) -> Errors:
        """Return the errors on the test runs, or on some of them."""
        return self.errors_in(solved, [name for name in self.test_names if name not in without])

    def errors_in(self, solved: Solved, names: Iterable[str]) -> Errors:
        """Return the errors on some runs."""
        found = [(name, self.residuals(solved, name)) for name in names]
        left = {name: one[-1] for name, one in found if one is not None}
        return Errors(
            {name: float(np.sum((e - e.mean()) ** 2)) for name, e in left.items()},
            {name: float(e @ e) for name, e in left.items()},
            {name: len(e) for name, e in left.items()},
        )

    def written(self, parts: Sequence[Addition]) -> Model:
        """Return the model with the causes that a file can hold.

        Values are those of `solve` with these causes. Spreads and intervals are of a bootstrap over
        the training runs, to first order in shapes too (`estimation.fitting.fit`). A cause that
        contains a declared term, as a curved spring contains a linear one, takes its place. A term
        that cannot be identified next to the declared ones is left out.
        """
        solved = self.solve(parts)
        terms = [p.term for p in solved.parts if p.is_written and p.term is not None]
        campaign = Campaign.of([self.recordings[n] for n in self.train_names])
        moved = dict(zip(map(id, self._declared), solved.declared, strict=True))
        # a shape may have moved to where a declared term is as good as an offset
        tried = itertools.product(range(len(terms), -1, -1), (moved, {}))
        for count, own in tried:
            known = [own.get(id(term), term) for term in self.model.terms]
            model = replace(self.model, terms=_joined(known, terms[:count]), evidence=None)
            with suppress(FitError):
                return without_unused(fit(model, campaign, bootstrap=DRAWS, shapes="keep"))
        return fit(model, campaign, bootstrap=DRAWS, shapes="keep")

    def settled(self, parts: Sequence[Addition]) -> list[Addition]:
        """Return causes with the shapes that they were fitted with next to one another."""
        solved = self.solve(parts)
        self._solved[tuple(map(id, solved.parts))] = solved.parts, solved
        return list(solved.parts)

    def predict_next_to(self, parts: Sequence[Addition]) -> None:
        """Predict the target by the declared terms as they are fitted next to some causes.

        Without the causes these terms stand in for them, and what reads their prediction would be
        of another size.
        """
        for _ in range(MOVES):
            known, runs, solved = self.model, self._runs, self.solve(parts)
            weights, declared = iter(solved.weights), {}
            for term, own in zip(self._declared, solved.declared, strict=True):
                sizes = {p.name: Estimate(float(next(weights))) for p in term.effect.amplitudes}
                declared[id(term)] = replace(own, values={**own.values, **sizes})
            terms = tuple(declared.get(id(term), term) for term in known.terms)
            signals = with_prediction(replace(known, terms=terms), self.noisy).signals
            self.model, self._runs, self._solved = replace(known, signals=signals), {}, {}
            if self.solve(parts).squared >= solved.squared:
                self.model, self._runs, self._solved = known, runs, {}
                return

    def _fitted(self, parts: tuple[Addition, ...]) -> Solved:
        solved, share = self._amplitudes(parts, tuple(self._declared)), 1.0
        for _ in range(MOVES if parts and any(moving for _, moving in _terms(solved)) else 0):
            further = self._amplitudes(*self._moved(solved, share))
            if further.squared < solved.squared:
                solved = further
            else:
                share *= 0.5
        return solved

    def _amplitudes(self, parts: tuple[Addition, ...], declared: tuple[Term, ...]) -> Solved:
        grams, means, samples = [], [], 0
        runs = [*self._train_runs(parts)]
        for run in runs:
            table = _table(parts, declared, run, run.places)
            whole = np.column_stack([table, run.whole[self.model.target][run.places]])
            means.append(whole.mean(axis=0))
            grams.append(self._products(whole))
            samples += len(whole)
        gram = np.sum(grams, axis=0)
        penalty, low, high = self._limits(parts)
        penalty = penalty * samples / (len(grams) * self.numbers.samples_a_run)
        normal, same = gram[:-1, :-1] + np.diag(penalty), one_constant(declared, runs)
        weights = solve_apart(normal, gram[:-1, -1], low, high, same)
        level = 0.0
        if self.model.run_offsets:
            level = float(np.mean([m[-1] - m[:-1] @ weights for m in means]))
        left = np.append(-weights, 1.0)
        return Solved(parts, declared, weights, level, float(left @ gram @ left))

    def _moved(self, solved: Solved, share: float) -> tuple[tuple[Addition, ...], tuple[Term, ...]]:
        """Return causes and declared terms, their shapes a share of a Gauss-Newton step further."""
        terms = _terms(solved)
        widths = [len(term.effect.amplitudes) for term, _ in terms]
        weights = np.split(solved.weights, np.cumsum(widths))
        acts = [None] * len(solved.declared) + [p.acts for p in solved.parts if p.term is not None]
        runs = list(self._train_runs(solved.parts))
        channels = {channel for term, _ in terms for channel in term.channels.values()}
        sizes = {c: float(np.std(np.concatenate([r.thin[c] for r in runs]))) for c in channels}
        products = []
        for run in runs:
            table = _table(solved.parts, solved.declared, run, run.places)
            left = run.whole[self.model.target][run.places] - table @ solved.weights
            own = [
                slope * float(some is None or run.whole.name in some)
                for (term, moving), weight, some in zip(terms, weights, acts, strict=False)
                for slope in shapes.slopes(term, moving, weight, sizes, partial(_columns, run=run))
            ]
            products.append(self._products(np.column_stack([table, *own, left])))
        found = iter(shapes.moved(terms, np.sum(products, axis=0), share, sizes))
        declared = tuple(next(found) for _ in solved.declared)
        parts = [p if p.term is None else replace(p, term=next(found)) for p in solved.parts]
        return tuple(parts), declared

    def _train_runs(self, parts: Sequence[Addition]) -> Iterator[FitRun]:
        """Yield the training runs that have a sample of the equation."""
        for name in self.train_names:
            if (known := self._run(parts, name)) is not None:
                yield known[0]

    def _products(self, whole: FloatArray) -> FloatArray:
        """Return products of columns, each run's mean removed where offsets are a nuisance."""
        centred = whole - whole.mean(axis=0) if self.model.run_offsets else whole
        return np.asarray(centred.T @ centred)

    def _limits(self, parts: Sequence[Addition]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the penalty and the bounds of every amplitude, shape (k,) each."""
        of_terms = [(term, False) for term in self._declared]
        of_terms += [(part.term, part.is_change) for part in parts if part.term is not None]
        rows = [
            (0.0, -np.inf, np.inf) if is_change else (0.0, p.lower, p.upper)
            for term, is_change in of_terms
            for p in term.effect.amplitudes
        ]
        for part in parts:
            if part.unwritten is not None:
                rows += [(part.precision, -np.inf, np.inf)] * self._width(part)
        penalty, low, high = np.array(rows).T
        return penalty, low, high

    def _width(self, part: Addition) -> int:
        """Return the number of a cause's amplitudes."""
        if part.unwritten is not None:
            return int(part.unwritten(self.train_names[0], np.zeros(1)).shape[1])
        return len(part.term.effect.amplitudes) if part.term is not None else 0

    def _run(self, parts: Sequence[Addition], name: str) -> tuple[FitRun, NDArray[np.intp]] | None:
        """Return a run and the samples that its error counts; None without a sample to fit."""
        terms = [p.term for p in parts if p.term is not None]
        key = frozenset(c for t in terms for c in t.reads) - {*self.model.channels}
        held = self._runs.setdefault(key, {})
        if name not in held:
            model = replace(self.model, terms=(*self.model.terms, *terms))
            try:
                (run,) = prepared(model, Campaign.of([self.recordings[name]]))
            except FitError:
                held[name] = None
            else:
                step = max(1, int(run.whole.sample_rate_hz / (4 * model.low_pass.cutoff_hz)))
                # what a cause reads decides no motion: before and after count the same samples
                own = {c: x for c, x in run.whole.columns.items() if c not in key}
                whole = replace(run.whole, columns=own)
                held[name] = (
                    run,
                    settled_places(whole, model.low_pass, step, model.samples, model.signals),
                )
        return held[name]


def _joined(declared: Sequence[Term], terms: Sequence[Term]) -> tuple[Term, ...]:
    """Return declared terms and others; one that contains a declared term is in its place."""
    out, after = [*declared], []
    for term in terms:
        inside = [k for k, one in enumerate(out) if _contains(term, one)]
        if inside:
            out[inside[0]] = term
        else:
            after.append(term)
    return (*out, *after)


def _contains(term: Term, declared: Term) -> bool:
    """Whether the columns of a declared term are among those of another form of its family."""
    own, other = declared.effect, term.effect
    same_place = (declared.sign, declared.channels) == (term.sign, term.channels)
    inside = {*own.amplitudes} < {*other.amplitudes} and not own.shape
    return own.family == other.family and same_place and inside


def _terms(solved: Solved) -> list[tuple[Term, shapes.Moving]]:
    """Return the terms in the order of their weights: declared ones, then those of causes.

    Each has the shapes of it that move.
    """
    found = [p.term for p in solved.parts if p.term is not None]
    return [
        *((term, shapes.moving(term, is_declared=True)) for term in solved.declared),
        *((term, shapes.moving(term, is_declared=False)) for term in found),
    ]


def _table(
    parts: Sequence[Addition], declared: Sequence[Term], run: FitRun, places: NDArray[np.intp]
) -> FloatArray:
    """Return the signed columns of a run: declared, found, and those without a term, (n, k)."""
    name, blocks = run.whole.name, [_columns(term, run, places) for term in declared]
    for part in parts:
        if part.term is not None:
            acts = part.acts is None or name in part.acts
            blocks.append(_columns(part.term, run, places) * float(acts))
    since_s = run.whole.time_s[places] - run.whole.time_s[0]
    blocks += [p.unwritten(name, since_s) for p in parts if p.unwritten is not None]
    return np.hstack(blocks)


def _columns(term: Term, run: FitRun, places: NDArray[np.intp] | None = None) -> FloatArray:
    """Return a term's signed columns at places of a run, by default at those that are fitted."""
    return term.sign * run.columns(term, term.numbers(term.effect.shape), places)
