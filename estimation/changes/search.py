"""The search for changes: the largest one first, against every other choice of runs.

If nothing changed, the runs of the two campaigns are exchangeable: which of them are called A and
which B is arbitrary. The gain of the best candidate is therefore compared with the gain of the best
candidate under random choices of runs; this maximum covers all candidates at once, so the
probability of any wrong change is the level (Westfall and Young 1993). Runs under the same
conditions are exchanged among themselves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimation.changes.candidates import Came, Candidate, Moved, candidates, columns_of
from estimation.changes.regression import (
    TINY,
    Laid,
    Products,
    Regression,
    gains,
    solved,
    squared_error,
)
from estimation.recording import FloatArray

CHOICES = 299
"""Random choices of runs."""

LEVEL = 0.05
"""Probability of a wrong change where nothing changed."""

SURE = 0.9
"""Weight from which a single name is given; below it the verdict is a set."""

REPLICATES = 200
"""Resampled sets of runs, for intervals and for how sure a name is."""

KEPT = 200
"""Candidates that stay in the search after its first step."""

MOST_CHANGES = 4

LEAST_TERM = 0.05
"""Part of its equation's target, root mean square, below which a term may have either sign."""

FORM = 0.05
"""Share of what a change explains that a wrong form of it can amount to. A further change removes
more than that of the squared error removed so far, and an effect that came explains more than that
beyond a parameter that moved."""


@dataclass(frozen=True)
class Gained:
    """A candidate that acts in the runs of one campaign.

    Attributes:
        candidate: What changed.
        in_b: Whether it acts in the runs of B; else in those of A.
        gain: Log of the squared error before over after, above the mean over random choices.
        usual: That mean.
        amplitudes: Its amplitudes, SI, shape (k,).
    """

    candidate: Candidate
    in_b: bool
    gain: float
    usual: float
    amplitudes: FloatArray

    @property
    def family(self) -> str:
        """What a report calls it; a parameter of an equation is a name of its own."""
        return self.candidate.key


@dataclass(frozen=True)
class Step:
    """One change that was found.

    Attributes:
        best: The change.
        p: Share of random choices of runs with as large a gain of any candidate.
        shares: Name to its weight over resampled sets of runs, largest first. A name that explains
            less than the best by `FORM` of it has 1/e of its weight: forms are not exact. Where a
            parameter that moved explains most, effects have none.
        spread: Amplitudes in the resampled sets, shape (replicates, k).
        alternatives: Name to its best candidate.
    """

    best: Gained
    p: float
    shares: Mapping[str, float]
    spread: FloatArray
    alternatives: Mapping[str, Gained]


@dataclass(frozen=True, eq=False)
class _Held:
    candidate: Candidate
    laid: Laid


def impossible(regression: Regression, is_b: FloatArray) -> dict[str, str]:
    """Return equations with a declared amplitude beyond its bounds, and which one it is.

    Such an equation's parameters are not identifiable from these runs: a change of one would be
    attributed to another. Each campaign is fitted on its own, since a change distorts a fit of
    both; an equation is left out where neither fit is within its bounds.
    """
    first, second = (_beyond(regression, counts) for counts in (1 - is_b, is_b))
    return {name: what for name, what in first.items() if name in second}


def _beyond(regression: Regression, counts: FloatArray) -> dict[str, str]:
    parameters = solved(regression.gram(counts))
    out = {}
    for name, equation in regression.layout.equations.items():
        column = 0
        for term in equation.terms:
            for parameter in term.effect.amplitudes:
                value = parameters[regression.declared_column(name, column)]
                # a term that is next to nothing may have either sign
                counts = abs(value) * regression.size_of(name, column) > LEAST_TERM
                if counts and not parameter.lower <= value <= parameter.upper:
                    out[name] = f"{term.effect.id} {parameter.name}"
                column += 1
    return out


def search(
    regression: Regression, is_b: FloatArray, strata: Sequence[str], seed: int
) -> list[Step]:
    """Find what changed, the largest change first.

    Args:
        regression: The declared equations on the runs of both campaigns.
        is_b: 1 for each run of B, 0 for each of A, shape (runs,).
        strata: Conditions of each run, as one word.
        seed: Seed of the random choices.

    Returns:
        The changes; none where no gain is larger than random choices of runs give.
    """
    random = np.random.default_rng(seed)
    choices = _choices(is_b, strata, random)
    without = impossible(regression, is_b)
    pool = [h for h in _laid_out(regression) if h.candidate.equation not in without]
    steps: list[Step] = []
    declared = squared_error(regression.gram())
    while len(steps) < MOST_CHANGES and pool:
        ranked, largest = _ranked(regression, pool, choices)
        if not ranked:
            break
        best, held = ranked[0]
        p = float((1 + np.sum(largest[1:] >= best.gain)) / len(choices))
        grown = regression.grown(held.laid, is_b if best.in_b else 1 - is_b)
        now, then = squared_error(regression.gram()), squared_error(grown.gram())
        if p > LEVEL or now - then < FORM * (declared - now):
            break
        pool = [one for _, one in ranked[:KEPT]]
        step = _resampled(regression, ranked, is_b, p, random)
        # what the wrong form of the first change amounts to has no name that stands out
        if steps and next(iter(step.shares.values()), 0.0) < SURE:
            break
        steps.append(step)
        regression = grown
        pool = [one for one in pool if one.candidate.key != held.candidate.key]
    return steps


def _choices(is_b: FloatArray, strata: Sequence[str], random: np.random.Generator) -> FloatArray:
    """Return the true choice of runs, then random ones, shape (1 + choices, runs).

    Runs are exchanged within their stratum where every stratum has runs of both campaigns.
    """
    groups = [np.array([s == name for s in strata]) for name in dict.fromkeys(strata)]
    if any(len(set(is_b[group])) < 2 for group in groups):
        groups = [np.ones(len(is_b), bool)]
    out = [is_b]
    for _ in range(CHOICES):
        drawn = is_b.copy()
        for group in groups:
            drawn[group] = random.permutation(is_b[group])
        out.append(drawn)
    return np.array(out, dtype=float)


def _laid_out(regression: Regression) -> list[_Held]:
    pool = []
    for candidate in candidates(regression.layout):
        laid = laid_out(candidate, regression)
        if laid is not None:
            pool.append(_Held(candidate, laid))
    return pool


def laid_out(candidate: Candidate, regression: Regression) -> Laid | None:
    """Return a candidate's rows in every run; None where they are not finite."""
    columns = columns_of(candidate, regression.layout)
    if columns is None:
        return None
    declared = None
    if isinstance(candidate, Moved):
        declared = regression.declared_column(candidate.equation, candidate.column)
    return regression.laid(columns, declared)


def _ranked(
    regression: Regression, pool: Sequence[_Held], choices: FloatArray
) -> tuple[list[tuple[Gained, _Held]], FloatArray]:
    """Return the candidates by their gain, and the largest gain of each choice of runs."""
    gram = regression.gram()
    ranked: list[tuple[Gained, _Held]] = []
    largest = np.full(len(choices), -np.inf)
    for held in pool:
        products = regression.products(held.laid)
        for in_b in (True, False) if isinstance(held.candidate, Came) else (True,):
            acts = choices if in_b else 1 - choices
            found, amplitudes = gains(gram, products, acts)
            found = _worth(held.candidate) * found
            usual = float(found[1:].mean())
            largest = np.maximum(largest, found - usual)
            if isinstance(held.candidate, Came) and not held.candidate.may_have(amplitudes[0]):
                continue
            one = Gained(held.candidate, in_b, float(found[0]) - usual, usual, amplitudes[0])
            ranked.append((one, held))
    ranked.sort(key=lambda pair: -pair[0].gain)
    return ranked, largest


def _resampled(
    regression: Regression,
    ranked: Sequence[tuple[Gained, _Held]],
    is_b: FloatArray,
    p: float,
    random: np.random.Generator,
) -> Step:
    """Return how often each name is the best when runs are drawn again, and the amplitudes."""
    best = ranked[0][0]
    near = _best_of_each(ranked, best.gain)
    laid = [(one, regression.products(held.laid)) for one, held in near]
    prior = _prior([one.candidate for one, _ in ranked], [one.candidate for one, _ in near])
    moved = np.array([not isinstance(one.candidate, Came) for one, _ in near])
    wins: dict[str, float] = {}
    spread = []
    groups = [np.flatnonzero(is_b == side) for side in (0, 1)]
    for _ in range(REPLICATES):
        counts = np.zeros(len(is_b))
        for group in groups:
            np.add.at(counts, random.choice(group, len(group)), 1)
        if any(np.count_nonzero(counts[group]) < 2 for group in groups):
            continue
        gram = regression.gram(counts)
        found = [_one(gram, products, one, is_b, counts) for one, products in laid]
        gained = np.array([f[0] - one.usual for f, (one, _) in zip(found, laid, strict=True)])
        weights = prior * np.exp((gained - gained.max()) / max(FORM * gained.max(), TINY))
        if moved[np.argmax(gained)]:  # no new effect where a parameter explains as much
            weights = weights * moved
        for (one, _), weight in zip(laid, weights / weights.sum(), strict=True):
            wins[one.family] = wins.get(one.family, 0.0) + float(weight)
        spread.append(found[0][1])
    total = sum(wins.values()) or 1.0
    shares = dict(sorted(((n, w / total) for n, w in wins.items()), key=lambda pair: -pair[1]))
    return Step(best, p, shares, np.array(spread), {one.family: one for one, _ in near})


def _prior(pool: Sequence[Candidate], near: Sequence[Candidate]) -> FloatArray:
    """Return the prior weights of some candidates, shape (n,).

    A parameter that moved and an effect that came are as likely; names of one kind share evenly.
    """
    names = {kind: {c.key for c in pool if isinstance(c, Came) is kind} for kind in (True, False)}
    return np.array([1.0 / len(names[isinstance(c, Came)]) for c in near])


def _one(
    gram: FloatArray, products: Products, one: Gained, is_b: FloatArray, counts: FloatArray
) -> tuple[float, FloatArray]:
    acts = (is_b if one.in_b else 1 - is_b)[None]
    found, amplitudes = gains(gram, products, acts, counts)
    return _worth(one.candidate) * float(found[0]), amplitudes[0]


def _worth(candidate: Candidate) -> float:
    """Return how much a gain counts: an effect has to explain more than a parameter that moved."""
    return 1.0 - FORM if isinstance(candidate, Came) else 1.0


def _best_of_each(
    ranked: Sequence[tuple[Gained, _Held]], best: float
) -> list[tuple[Gained, _Held]]:
    """Return the best candidate of each name that gains at least half of the best, best first."""
    out: dict[str, tuple[Gained, _Held]] = {}
    for one, held in ranked:
        if one.gain >= 0.5 * best and one.family not in out:
            out[one.family] = (one, held)
    return list(out.values())
