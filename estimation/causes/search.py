"""The search over hypotheses: sets of causes, scored together, extended one cause at a time."""

import itertools
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.causes.equations import Layout
from estimation.causes.folds import Folds, folds_of
from estimation.causes.functions import Function, functions_at
from estimation.causes.joint import Columns, Joint, Laid, Part, Scale
from estimation.causes.numbers import DEFAULT, Numbers
from estimation.causes.places import places_of
from estimation.causes.sources import RELATIVE, Bend, Source, sources_at
from estimation.recording import FloatArray

AT_ONCE = 3000
"""Candidates times squared columns in one block: keeps its memory small."""

MOST_CAUSES = 3
NOTHING = 1e-12
"""Norm of a column, in declared errors of its equations for one unit, below which it is zero."""

KNOTS_OF_BEND, BENT = 5, 24
"""Hat functions of a form's deviation from its equation, and families that are given one."""

REFINED = 8
"""Families whose shapes are refined after the grid."""

PARTIAL, CHOICES = 24, 6
"""Names tried on some of the runs alone, and choices of runs of each."""


@dataclass(frozen=True)
class Candidate:
    """A cause laid out on the runs.

    Attributes:
        cause: The named effect or smooth function.
        laid: Its columns of every run, without what the declared columns explain.
        precision: Prior precision of every amplitude.
        acts: Runs in which it acts; in all when None.
        choices: Forms that share the prior probability of a cause, times the points of its grid.
    """

    cause: Source | Function
    laid: Laid
    precision: FloatArray
    acts: tuple[bool, ...] | None = None
    choices: int = 1

    @property
    def name(self) -> tuple[str, str, tuple[str, ...]]:
        """What is claimed: place, family, and the variables of a function."""
        variables = self.cause.variables if isinstance(self.cause, Function) else ()
        return self.cause.place.name, self.cause.family, variables

    @property
    def columns(self) -> Sequence[Columns]:
        """Its columns of every run."""
        return self.laid.columns

    @property
    def is_function(self) -> bool:
        """Whether its form is unknown."""
        return isinstance(self.cause, Function)

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(next(iter(self.columns[0].values())).shape[1])


@dataclass(frozen=True)
class Scored:
    """A candidate with its score given a base.

    Attributes:
        candidate: The candidate.
        score: Mean of the families of folds, less the price of what was chosen.
        by_family: Score of each family of folds.
        amplitudes: Its amplitudes on all runs, in the scale of its columns.
    """

    candidate: Candidate
    score: float
    by_family: FloatArray
    amplitudes: FloatArray
    by_run: tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class Found:
    """The answer of the search.

    Attributes:
        causes: The leading hypothesis, in the order found; empty when nothing is missing.
        conditional: For each cause, every candidate in its place given the others, best first.
        joint: The regression of the training runs without causes.
        clean_score: The best score when nothing was claimed.
    """

    causes: Sequence[Scored]
    conditional: Sequence[Sequence[Scored]]
    joint: Joint
    clean_score: float


def search(train: Layout, numbers: Numbers = DEFAULT) -> Found:
    """Find the set of causes that explains training runs best.

    Args:
        train: The declared equations on the training runs, instruments added.
        numbers: What decides.
    """
    joint, folds = Joint(train, numbers), folds_of(train)
    pool = candidates(train, joint)
    first = _ranked(joint, pool, folds, numbers)
    if not first or first[0].score < 0.0:
        return Found([], [], joint, first[0].score if first else 0.0)
    chains = [_chain(joint, start, pool, folds, numbers) for start in _starts(first)]
    causes = list(max(chains, key=lambda chain: sum(c.score for c in chain)))
    conditional = []
    for k, cause in enumerate(causes):
        others = [c for c in causes if c is not cause]
        # with the others there, noise may hide every candidate: the cause then stands by its chain
        ranked = _ranked(_with(joint, others), pool, folds, numbers) or [cause]
        conditional.append(ranked)
        causes[k] = ranked[0]
    return Found(causes, conditional, joint, first[0].score)


def _starts(ranked: Sequence[Scored]) -> list[Scored]:
    """Return where a chain of causes may begin: the best, and the best of the other kind."""
    other = next(
        (s for s in ranked if s.candidate.is_function != ranked[0].candidate.is_function), None
    )
    worth = other is not None and other.score > 0.5 * ranked[0].score
    return [ranked[0], other] if other is not None and worth else [ranked[0]]


def _chain(
    joint: Joint, start: Scored, pool: Sequence[Candidate], folds: Folds, numbers: Numbers
) -> list[Scored]:
    """Return a set of causes, extended one at a time while another one is worth its price."""
    causes = [start]
    while len(causes) < MOST_CAUSES:
        ranked = _ranked(_with(joint, causes), pool, folds, numbers)
        if not ranked or ranked[0].score < 0.0:
            break
        causes.append(ranked[0])
    return causes


def candidates(train: Layout, joint: Joint) -> list[Candidate]:
    """Return every candidate cause, laid out."""
    out = []
    for place in places_of(train):
        named: Iterable[Source | Function] = sources_at(train, place)
        for cause in itertools.chain(named, functions_at(train, place)):
            laid = laid_out(train, joint, cause)
            if laid is not None:
                out.append(laid)
    for run in train.runs:
        run.memo.clear()  # columns of the whole run, many times as large as those on the grid
    count = Counter(_form(c) for c in out)
    return [replace(c, choices=count[_form(c)] * len(count)) for c in out]


def _form(candidate: Candidate) -> tuple[str, str]:
    """Return the key of one prior probability: a form of an effect, or all smooth functions."""
    cause = candidate.cause
    return cause.place.name, "" if isinstance(cause, Function) else cause.effect.id


def shares_of(ranked: Sequence[Scored], numbers: Numbers) -> FloatArray:
    """Return the probability of each candidate by its score alone, shape (n,)."""
    scores = np.array([s.score for s in ranked])
    weights = np.exp(numbers.sharpness * (scores - scores.max()))
    return np.asarray(weights / weights.sum())


def posterior(ranked: Sequence[Scored], numbers: Numbers) -> FloatArray:
    """Return the probability of each candidate, shape (n,).

    Only what is better than no cause at all competes with the best.
    """
    scores = np.array([s.score for s in ranked])
    kept = np.where((scores > 0.0) | (scores == scores.max()), shares_of(ranked, numbers), 0.0)
    return np.asarray(kept / kept.sum())


def best_of_each(scored: Sequence[Scored]) -> list[Scored]:
    """Return the best candidate of each name, best first."""
    best: dict[object, Scored] = {}
    for one in scored:
        known = best.get(one.candidate.name)
        if known is None or one.score > known.score:
            best[one.candidate.name] = one
    return sorted(best.values(), key=lambda s: -s.score)


def evaluate(
    joint: Joint, pool: Sequence[Candidate], folds: Folds, numbers: Numbers
) -> list[Scored]:
    """Return the score of each candidate given the base; those of a wrong sign are left out."""
    base = joint.base_errors(folds), [joint.extrapolated(family) for family in folds]
    by_width: dict[int, list[Candidate]] = {}
    for candidate in pool:
        by_width.setdefault(candidate.width, []).append(candidate)
    out = []
    for width, group in by_width.items():
        size = max(1, AT_ONCE // (width * width)) if width > 2 else 400
        for start in range(0, len(group), size):
            part = group[start : start + size]
            out += _evaluated(joint, part, folds, base, numbers)
    return out


def _evaluated(
    joint: Joint,
    part: list[Candidate],
    folds: Folds,
    base: tuple[Sequence[Mapping[Part, FloatArray]], Sequence[Mapping[Part, float]]],
    numbers: Numbers,
) -> list[Scored]:
    precision = np.vstack([c.precision for c in part])
    outcome = joint.evaluate(joint.block([c.laid for c in part]), folds, precision)
    before, spreads = base
    scores, by_family = joint.score(spreads, before, outcome.errors)
    out = []
    for k, candidate in enumerate(part):
        amplitudes = outcome.amplitudes[k]
        if _sign_is_wrong(candidate, amplitudes):
            continue
        if joint.replaces(candidate.laid, outcome.base[k], amplitudes):
            continue
        score = float(scores[k]) - _price(candidate, numbers)
        by_run = outcome.cross[:, k], outcome.own[:, k]
        out.append(Scored(candidate, score, by_family[:, k], amplitudes, by_run))
    return out


def _precision(joint: Joint, cause: Source | Function, size: FloatArray) -> FloatArray:
    """Return the prior precision of each amplitude.

    A named effect, scaled to norm one, is not larger than half of all signals; a smooth function's
    knots have a standard deviation of so many declared errors.
    """
    everything = np.full(len(size), 4.0 / joint.power)
    if isinstance(cause, Function):
        knot = [e.gain**2 / joint.error[e.equation, "within"] for e in cause.place.enters]
        return np.asarray(everything + np.mean(knot) / joint.numbers.knot_sd**2)
    if cause.bend is not None:
        everything[1:] += 1.0 / (cause.bend.sd * size[1:]) ** 2
    return everything


def _sign_is_wrong(candidate: Candidate, amplitudes: FloatArray) -> bool:
    cause = candidate.cause
    if isinstance(cause, Function) or not cause.is_bounded:
        return False
    count = len(cause.parts)  # a bend comes after them
    return float(np.sum(amplitudes[:count] / candidate.laid.size[:count])) < 0.0


def _price(candidate: Candidate, numbers: Numbers) -> float:
    """Return the price of what was chosen: the logarithm of how many choices there were.

    The prior probability of a cause is shared by all forms at all places, that of a form by the
    points of its grid, that of an unknown form by the sets of variables, and that of acting in some
    of the runs by all choices of them.
    """
    choices = float(np.log(candidate.choices))
    if candidate.acts is not None:
        count, acting = len(candidate.acts), sum(candidate.acts)
        choices += float(np.log(count + 1.0)) + sum(
            float(np.log((count - k) / (k + 1.0))) for k in range(min(acting, count - acting))
        )
    more = numbers.function_cost if candidate.is_function else 0.0
    return numbers.cause_cost + more + numbers.choice_price * choices


def _ranked(
    joint: Joint, pool: Sequence[Candidate], folds: Folds, numbers: Numbers
) -> list[Scored]:
    """Return the best of each name: on the grid, refined, and on some of the runs."""
    everything = evaluate(joint, pool, folds, numbers)
    best = best_of_each(everything)
    if not best:
        return []
    near = [c for s in best[:REFINED] for c in _neighbours(joint, s.candidate)]
    finer = evaluate(joint, near, folds, numbers) if near else []
    best = best_of_each([*best, *finer])
    bent = [c for s in best[:BENT] if (c := _bent(joint, s, numbers)) is not None]
    some = _on_some_runs(joint, everything, folds, numbers)
    return best_of_each([*best, *evaluate(joint, bent, folds, numbers), *some])


def _bent(joint: Joint, scored: Scored, numbers: Numbers) -> Candidate | None:
    """Return a named effect of one column with a form that deviates from its equation."""
    candidate, cause = scored.candidate, scored.candidate.cause
    if isinstance(cause, Function) or candidate.width != 1:
        return None
    signals = [cause.signal(run, cause.place.home) for run in joint.runs]
    values = np.concatenate([x[:, 0] for x in signals if x is not None])
    low, high = np.percentile(values, (1.0, 99.0))
    amplitude = abs(float(scored.amplitudes[0] / candidate.laid.size[0]))
    if not high > low or amplitude == 0.0:
        return None
    knots = tuple(float(x) for x in np.linspace(low, high, KNOTS_OF_BEND))
    bent = replace(cause, bend=Bend(knots, numbers.bend_share * amplitude))
    laid = laid_out(joint.layout, joint, bent, candidate.acts)
    return None if laid is None else replace(laid, choices=candidate.choices)


def _neighbours(joint: Joint, candidate: Candidate) -> list[Candidate]:
    """Return a named effect at shapes between the points of the grid."""
    cause = candidate.cause
    if isinstance(cause, Function):
        return []
    out = []
    for k, parameter in enumerate(cause.effect.shape):
        values = RELATIVE.get((cause.effect.id, parameter.name)) or RELATIVE.get(parameter.name)
        if parameter.name in ("width", "settled", "order") or values is None or len(values) < 2:
            continue
        ratio = values[1] / values[0]
        for step in (-0.5, -0.25, 0.25, 0.5):
            moved = (
                cause.shape[k] + step * (values[1] - values[0])
                if parameter.linear
                else cause.shape[k] * ratio**step
            )
            shape = (*cause.shape[:k], float(moved), *cause.shape[k + 1 :])
            laid = laid_out(joint.layout, joint, replace(cause, shape=shape))
            if laid is not None:
                out.append(replace(laid, choices=candidate.choices))
    return out


def _on_some_runs(
    joint: Joint, scored: Sequence[Scored], folds: Folds, numbers: Numbers
) -> list[Scored]:
    """Return named effects that act in some of the runs.

    Every effect is tried on cuts of two orders of the runs: of recording, and of the error that it
    removes in each of them. The choices of runs that promise most are scored like all others.
    """
    count = len(joint.runs)
    if count < 6:
        return []
    promise = []
    for one in scored:
        if one.candidate.is_function:
            continue
        cross, own = one.by_run
        gains = _removed(cross, own)
        for order in (np.arange(count), np.argsort(gains)[::-1]):
            for part in (order, order[::-1]):
                sums = [np.cumsum(x[part], axis=0)[1:-1] for x in (cross, own)]
                removed = _removed(*sums)
                promise += [
                    (float(r), one.candidate, tuple(int(i) for i in sorted(part[: k + 2])))
                    for k, r in enumerate(removed)
                ]
    promise.sort(key=lambda p: -p[0])
    tried, seen = [], dict[object, set[tuple[int, ...]]]()
    for _, candidate, chosen in promise:
        if candidate.name not in seen and len(seen) == PARTIAL:
            continue
        known = seen.setdefault(candidate.name, set())
        if len(known) == CHOICES or chosen in known:
            continue
        known.add(chosen)
        acts = tuple(k in chosen for k in range(count))
        laid = laid_out(joint.layout, joint, candidate.cause, acts)
        if laid is not None:
            tried.append(replace(laid, choices=candidate.choices))
    return evaluate(joint, tried, folds, numbers)


def _removed(cross: FloatArray, own: FloatArray) -> FloatArray:
    """Return the error that amplitudes remove, from products (n, k) and (n, k, k)."""
    size = np.einsum("nkk->n", own)[:, None, None]
    steady = own + (1e-6 * size + 1e-300) * np.eye(own.shape[1])
    return np.asarray(
        np.einsum("nk,nk->n", cross, np.linalg.solve(steady, cross[..., None])[..., 0])
    )


def _with(joint: Joint, causes: Sequence[Scored]) -> Joint:
    for cause in causes:
        joint = joint.with_cause(cause.candidate.laid, cause.candidate.precision)
    return joint


def laid_out(
    layout: Layout, joint: Joint, cause: Source | Function, acts: tuple[bool, ...] | None = None
) -> Candidate | None:
    """Return a cause laid out on the runs in which it acts; None where it shows nowhere.

    Args:
        layout: The runs.
        joint: The regression of these runs.
        cause: The cause.
        acts: Whether it acts in each run; in all when None.
    """
    columns = []
    for k, run in enumerate(layout.runs):
        own = cause.columns(run)
        if own is None:
            return None
        if acts is not None and not acts[k]:
            own = {name: np.zeros_like(values) for name, values in own.items()}
        columns.append(own)
    unit: Scale = "none" if isinstance(cause, Function) else "first" if cause.bend else "each"
    laid = joint.laid(columns, unit)
    if float(laid.size.min()) < NOTHING:
        return None
    if acts is not None:  # what starts between runs also shifts their means, by its own offset
        laid = replace(
            laid,
            columns=[
                {p: np.zeros_like(v) if p[1] == "between" else v for p, v in own.items()}
                for own in laid.columns
            ],
        )
    return Candidate(cause, laid, _precision(joint, cause, laid.size), acts)
