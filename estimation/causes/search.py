"""The search over hypotheses: sets of causes, scored together, extended one cause at a time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation.causes.blocks import Outcome, block_of, evaluate
from estimation.causes.candidates import (
    Candidate,
    Claim,
    Group,
    candidates,
    groups_of,
    skews,
    with_skews,
)
from estimation.causes.equations import Layout
from estimation.causes.folds import Folds, folds_of
from estimation.causes.functions import Function
from estimation.causes.joint import Joint
from estimation.causes.numbers import DEFAULT, Numbers
from estimation.causes.sources import RELATIVE, Bend, Source
from estimation.recording import FloatArray

MOST_CAUSES = 3

MOST_CHANGE = 2.0
"""Factor by which the largest linear term of an equation may change next to a cause."""

KNOTS_OF_BEND, BENT = 5, 24
"""Hat functions of a form's deviation from its equation, and families that are given one."""

REFINED = 8
"""Families whose shapes are refined after the grid."""

PARTIAL, CHOICES = 24, 6
"""Names tried on some of the runs alone, and choices of runs of each."""


@dataclass(frozen=True)
class Scored:
    """A candidate with its score given a base.

    Attributes:
        candidate: The candidate.
        score: Mean of the families of folds, less the price of what was chosen.
        gain: The same with the price left in.
        by_family: Score of each family of folds.
        amplitudes: Its amplitudes on all runs, in the scale of its columns.
        by_run: Products of its columns with the base's residual, with themselves and with the base,
            of each run.
    """

    candidate: Candidate
    score: float
    gain: float
    by_family: FloatArray
    amplitudes: FloatArray
    by_run: tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Found:
    """The answer of the search.

    Attributes:
        causes: The leading hypothesis, in the order found; empty when nothing is missing.
        conditional: For each cause, every candidate in its place given the others, best first.
        joint: The regression of the training runs without causes.
        first: Every candidate when nothing is claimed, best first.
        late: Short delays of readings that are part of the base.
    """

    causes: Sequence[Scored]
    conditional: Sequence[Sequence[Scored]]
    joint: Joint
    first: Sequence[Scored]
    late: Sequence[Claim] = ()


def search(train: Layout, numbers: Numbers = DEFAULT) -> Found:
    """Find the set of causes that explains training runs best.

    Args:
        train: The declared equations on the training runs, instruments added.
        numbers: What decides.
    """
    plain = Joint(train, numbers)
    late = skews(plain)
    joint = with_skews(plain, late)
    ranking = Ranking(joint, candidates(joint), folds_of(train))
    first = ranking.next_to([])
    if not first or first[0].score < 0.0:
        return Found([], [], joint, first, late)
    causes, conditional = hypothesis(ranking, _starts(first))
    return Found(causes, conditional, joint, first, late)


def hypothesis(
    ranking: "Ranking", starts: Sequence[Scored]
) -> tuple[list[Scored], list[Sequence[Scored]]]:
    """Return the best set of causes, and all that compete in the place of each.

    Args:
        ranking: The candidates.
        starts: Causes with which a set may begin.
    """
    chains = [_chain(ranking, start) for start in starts]
    return _settled(ranking, max(chains, key=lambda chain: sum(c.score for c in chain)))


Rank = Callable[[Joint, Sequence[Group], Folds], list[Scored]]
"""Regression, candidates and folds to the best candidate of each name, best first."""


class Ranking:
    """Candidates in the order of their scores next to causes that were accepted.

    Args:
        joint: The regression without causes.
        pool: The candidates, with their products with it.
        folds: What is left out.
        rank: Ranks the candidates next to a regression's base, the best of each name.
    """

    def __init__(
        self, joint: Joint, pool: Sequence[Group], folds: Folds, rank: "Rank | None" = None
    ) -> None:
        self.joint, self.folds, self.pool = joint, folds, pool
        self._rank = rank or _ranked
        self._known: dict[frozenset[int], list[Scored]] = {}

    def next_to(self, causes: Sequence[Scored]) -> list[Scored]:
        """Return the best of each name next to causes."""
        key = frozenset(id(c.candidate) for c in causes)
        if key not in self._known:
            self._known[key] = self._rank(self._with(causes), self.pool, self.folds)
        return self._known[key]

    def _with(self, causes: Sequence[Scored]) -> Joint:
        joint = self.joint
        for cause in causes:
            joint = joint.with_cause(cause.candidate.laid, cause.candidate.precision)
        return joint


def _starts(ranked: Sequence[Scored]) -> list[Scored]:
    """Return where a chain of causes may begin: the best, and the best of the other kind."""
    other = next(
        (s for s in ranked if s.candidate.is_function != ranked[0].candidate.is_function), None
    )
    worth = other is not None and other.score > 0.5 * ranked[0].score
    return [ranked[0], other] if other is not None and worth else [ranked[0]]


def _chain(ranking: Ranking, start: Scored) -> list[Scored]:
    """Return a set of causes, extended one at a time while another one is worth its price."""
    causes = [start]
    while len(causes) < MOST_CAUSES:
        ranked = ranking.next_to(causes)
        if not ranked or ranked[0].score < 0.0:
            break
        causes.append(ranked[0])
    return causes


def _settled(
    ranking: Ranking, causes: Sequence[Scored]
) -> tuple[list[Scored], list[Sequence[Scored]]]:
    """Return causes, each the best next to the others, and what competes in the place of each.

    A cause that is not worth its price next to the others goes, the least first.
    """
    settled, conditional = list(causes), list[Sequence[Scored]]()
    for k, cause in enumerate(causes):
        # next to the others every candidate may be dropped: the cause then stands as it was found
        ranked = ranking.next_to([c for c in settled if c is not settled[k]]) or [cause]
        conditional.append(ranked)
        settled[k] = ranked[0]
    least = min(settled, key=lambda c: c.score)
    if least.score < 0.0 and len(settled) > 1:
        return _settled(ranking, [c for c in settled if c is not least])
    return settled, conditional


def shares_of(ranked: Sequence[Scored], numbers: Numbers) -> FloatArray:
    """Return the probability of each candidate by its score alone, shape (n,)."""
    scores = np.array([s.score for s in ranked])
    weights = np.exp(numbers.sharpness * (scores - scores.max()))
    return np.asarray(weights / weights.sum())


def posterior(ranked: Sequence[Scored], numbers: Numbers) -> FloatArray:
    """Return the probability of each candidate, shape (n,); the rest to one is that of no cause."""
    scores, gains = np.array([(s.score, s.gain) for s in ranked]).T
    return probabilities(scores, gains, numbers.sharpness)


def probabilities(scores: FloatArray, gains: FloatArray, sharpness: float) -> FloatArray:
    """Return the probability of each candidate, shape (n,); the rest to one is that of no cause.

    No cause at all has the score zero. What explains nothing has no share: of each weight that of
    the same candidate without its gain is taken off.

    Args:
        scores: Of the candidates, shape (n,).
        gains: Their scores before the price of what was chosen, shape (n,).
        sharpness: Log odds for one unit of score.
    """
    top = float(max(0.0, *scores))
    explains = -np.expm1(-sharpness * np.maximum(gains, 0.0))
    weights = np.exp(sharpness * (scores - top)) * explains
    return np.asarray(weights / (weights.sum() + np.exp(-sharpness * top)))


def best_of_each(scored: Sequence[Scored]) -> list[Scored]:
    """Return the best candidate of each name, best first."""
    best: dict[object, Scored] = {}
    for one in scored:
        known = best.get(one.candidate.name)
        if known is None or one.score > known.score:
            best[one.candidate.name] = one
    return sorted(best.values(), key=lambda s: -s.score)


def assessed(joint: Joint, pool: Sequence[Group], folds: Folds) -> list[Scored]:
    """Return the score of each candidate given the base; those of a wrong sign are left out."""
    before, spreads = joint.base_errors(folds), [joint.extrapolated(family) for family in folds]
    out = []
    for group in pool:
        block = block_of(joint, group.laid, group.block)
        outcome = evaluate(joint, block, folds, group.precision)
        replaces = _in_readings(joint, group.candidates, outcome)
        scores, by_family = joint.score(spreads, before, outcome.errors)
        for k, candidate in enumerate(group.candidates):
            amplitudes = outcome.amplitudes[k]
            if replaces[k] or _sign_is_wrong(candidate, amplitudes):
                continue
            gain = float(scores[k])
            score = gain - _price(candidate, joint)
            by_run = outcome.cross[:, k], outcome.own[:, k], outcome.base[:, k]
            out.append(Scored(candidate, score, gain, by_family[:, k], amplitudes, by_run))
    return out


def _in_readings(
    joint: Joint, candidates: Sequence[Candidate], outcome: Outcome
) -> NDArray[np.bool_]:
    """Count errors in the unit of an equation's largest reading, and return who replaces it.

    The residual may be that reading's noise. Who reads the same quantity through another sensor
    then shares the task with it and halves the noise, with nothing to do with a cause: the factor
    of the reading becomes smaller, by as much as the noise is less seen. And who reads the target
    itself has no use for the declared terms; a cause comes in addition to them. A cause that reads
    nothing but that reading does neither. Shape (n,).
    """
    replaces = np.zeros(len(candidates), dtype=np.bool_)
    for name, change in outcome.changes.items():
        channel = joint.largest_linear[name][1]
        other = np.array([not {*one.cause.reads} <= {channel} for one in candidates])
        unit = np.where(other, np.maximum(1.0, np.maximum(change, 1e-3) ** -2.0), 1.0)
        for family in outcome.errors:
            family[name, "within"][:] *= unit
        replaces |= other & ((change < 1.0 / MOST_CHANGE) | (change > MOST_CHANGE))
    return replaces


def _sign_is_wrong(candidate: Candidate, amplitudes: FloatArray) -> bool:
    cause = candidate.cause
    if isinstance(cause, Function) or not cause.is_bounded:
        return False
    count = len(cause.parts)  # a bend comes after them
    return float(np.sum(amplitudes[:count] / candidate.size[:count])) < 0.0


def _price(candidate: Candidate, joint: Joint) -> float:
    """Return the price of what was chosen: the logarithm of how many choices there were.

    The prior probability of a cause is shared by all forms at all places, that of a form by the
    points of its grid, that of an unknown form by the sets of variables, and that of acting in some
    of the runs by all choices of them. Each amplitude but the first costs what a parameter costs in
    the Bayesian information criterion (Schwarz 1978).
    """
    numbers = joint.numbers
    choices, cause = float(np.log(candidate.choices)), candidate.cause
    samples = numbers.samples_a_run * len(joint.runs)
    more = 0 if isinstance(cause, Function) else len(cause.parts) - 1
    changes = isinstance(cause, Function) and "time" in cause.variables
    chosen = candidate.acts is not None and not candidate.given
    rare = candidate.is_function + (changes or chosen)
    if candidate.acts is not None and chosen:
        count, acting = len(candidate.acts), sum(candidate.acts)
        choices += float(np.log(count + 1.0)) + sum(
            float(np.log((count - k) / (k + 1.0))) for k in range(min(acting, count - acting))
        )
    amplitudes = more * float(np.log(samples)) / samples
    return (
        numbers.cause_cost + numbers.rare_cost * rare + numbers.choice_price * choices + amplitudes
    )


def _ranked(joint: Joint, pool: Sequence[Group], folds: Folds) -> list[Scored]:
    """Return the best of each name: on the grid, refined, relaxed, and on some of the runs."""
    everything = assessed(joint, pool, folds)
    best = best_of_each(everything)
    near = [c for s in best[:REFINED] for c in _neighbours(s.candidate)]
    best = best_of_each([*best, *assessed(joint, groups_of(joint, near), folds)])
    bent = [c for s in best[:BENT] if (c := _bent(joint, s)) is not None]
    more = groups_of(joint, [*bent, *_on_some_runs(joint, everything)])
    return _by_whole_form(joint, best_of_each([*best, *assessed(joint, more, folds)]), folds)


def _by_whole_form(joint: Joint, ranked: Sequence[Scored], folds: Folds) -> list[Scored]:
    """Return a ranking in which causes that show by their odd part compete by their whole form.

    What follows the noise of a reading is found by its odd part alone. Which of several such causes
    of one place it is, a delay or a lag, shows in the even part: given that one of them is there,
    their noise favours neither.
    """
    groups: dict[object, list[Scored]] = {}
    for one in ranked:
        cause = one.candidate.cause
        if not isinstance(cause, Function) and cause.odd:
            groups.setdefault((cause.place.name, one.candidate.acts), []).append(one)
    changed: dict[object, Scored | None] = {}
    for group in groups.values():
        if len(group) < 2 or group[0].score < 0.0:
            continue
        near = [c for s in group for c in (s.candidate, *_neighbours(s.candidate))]
        whole = [replace(Claim(c.cause, c.acts, c.choices), cause=_whole(c.cause)) for c in near]
        found = best_of_each(assessed(joint, groups_of(joint, whole), folds))
        of_name = {one.candidate.name: one for one in found}
        for one in group:
            known = of_name.get(one.candidate.name)
            changed[one.candidate.name] = known and replace(
                one, score=group[0].score + known.score - found[0].score
            )
    out = [changed.get(one.candidate.name, one) for one in ranked]
    return sorted((one for one in out if one is not None), key=lambda one: -one.score)


def _whole(cause: Source | Function) -> Source | Function:
    return cause if isinstance(cause, Function) else replace(cause, odd=False)


def _bent(joint: Joint, one: Scored) -> Claim | None:
    """Return a named effect of one column with a form that deviates from its equation."""
    candidate, cause = one.candidate, one.candidate.cause
    if isinstance(cause, Function) or len(candidate.size) != 1:
        return None
    signals = [cause.signal(run, cause.place.home) for run in joint.runs]
    values = np.concatenate([x[:, 0] for x in signals if x is not None])
    low, high = np.percentile(values, (1.0, 99.0))
    amplitude = abs(float(one.amplitudes[0] / candidate.size[0]))
    if not high > low or amplitude == 0.0:
        return None
    knots = tuple(float(x) for x in np.linspace(low, high, KNOTS_OF_BEND))
    bend = Bend(knots, joint.numbers.bend_share * amplitude)
    return Claim(replace(cause, bend=bend), candidate.acts, candidate.choices)


def _neighbours(candidate: Candidate) -> list[Claim]:
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
            out.append(Claim(replace(cause, shape=shape), candidate.acts, candidate.choices))
    return out


def _on_some_runs(joint: Joint, everything: Sequence[Scored]) -> list[Claim]:
    """Return named effects that act in some of the runs, as promising as there are.

    Every effect is tried on cuts of two orders of the runs: of recording, and of its size in each
    of them.
    """
    count = len(joint.runs)
    if count < 6:
        return []
    inverse = joint.left_out([[]]).inverse[0]
    named: dict[int, list[Scored]] = {}
    for one in everything:
        if not one.candidate.is_function:
            named.setdefault(len(one.amplitudes), []).append(one)
    promise: list[tuple[float, Candidate, tuple[int, ...]]] = []
    for group in named.values():
        cross, own, base = (np.stack([s.by_run[i] for s in group]) for i in range(3))
        order = np.broadcast_to(np.arange(count), (len(group), count))
        sizes = np.argsort(_sizes(cross, own), axis=1)
        for runs in (order, order[:, ::-1], sizes, sizes[:, ::-1]):
            every = np.arange(len(group))[:, None]
            sums = [np.cumsum(x[every, runs], axis=1)[:, 1:-1] for x in (cross, own, base)]
            gains = _removed(inverse, *sums)
            for one, chosen, removed in zip(group, runs, gains, strict=True):
                promise += [
                    (float(r), one.candidate, tuple(sorted(chosen[: k + 2].tolist())))
                    for k, r in enumerate(removed)
                ]
    promise.sort(key=lambda p: -p[0])
    tried, seen = [], dict[object, set[tuple[int, ...]]]()
    for _, candidate, acting in promise:
        if candidate.name not in seen and len(seen) == PARTIAL:
            continue
        known = seen.setdefault(candidate.name, set())
        if len(known) < CHOICES and acting not in known:
            known.add(acting)
            acts = tuple(k in acting for k in range(count))
            tried.append(Claim(candidate.cause, acts, candidate.choices))
    return tried


def _sizes(cross: FloatArray, own: FloatArray) -> FloatArray:
    """Return the size of candidates in each run, of that in all runs, shape (candidates, runs).

    A run that shows little of a candidate is taken to have the size that all runs have.
    """
    everywhere = solved(cross.sum(axis=1), own.sum(axis=1))[:, None]
    shown = np.einsum("crj,crjk,crk->cr", everywhere, own, everywhere)
    apart = (everywhere * cross).sum(axis=-1) - shown
    return np.asarray(apart / (shown + 0.1 * shown.mean(axis=1, keepdims=True) + 1e-300))


def _removed(
    inverse: FloatArray, cross: FloatArray, own: FloatArray, base: FloatArray
) -> FloatArray:
    """Return the error that amplitudes remove, fitted together with the base.

    Args:
        inverse: Of the base's normal matrix, shape (base, base).
        cross: Products of the columns with the base's residual, shape (..., k).
        own: With themselves, shape (..., k, k).
        base: Of the base's columns with them, shape (..., base, k).
    """
    beyond = own - base.swapaxes(-1, -2) @ inverse @ base
    return np.asarray((cross * solved(cross, beyond)).sum(axis=-1))


def solved(cross: FloatArray, own: FloatArray) -> FloatArray:
    """Return amplitudes from products (..., k) and (..., k, k)."""
    size = np.einsum("...kk->...", own)[..., None, None]
    steady = own + (1e-6 * size + 1e-300) * np.eye(own.shape[-1])
    return np.asarray(np.linalg.solve(steady, cross[..., None])[..., 0])
