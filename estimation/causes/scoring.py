"""The score of a cause next to others, its price, and the probability of each."""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.causes.apart import FACTOR, UNEXPLAINED
from estimation.causes.blocks import Block, Outcome, Products, block_of, evaluate, rising
from estimation.causes.candidates import Candidate, Group
from estimation.causes.criterion import base_errors, extrapolated, score
from estimation.causes.folds import Folds
from estimation.causes.functions import Function
from estimation.causes.joint import Joint
from estimation.causes.laid import Part
from estimation.causes.numbers import Numbers
from estimation.causes.run_signals import EFFORTS
from estimation.causes.sources import Source
from estimation.derived import origin_of
from estimation.recording import FloatArray

MOST_CHANGE = 2.0
"""Factor by which the largest linear term of an equation may become smaller next to a cause. It may
become larger by any: without the cause it is as wrong as the cause is large."""

TURNED = 0.1
"""Share of a change by which a factor that cannot be negative may miss zero: it is measured."""

DIGITS = 4
"""Decimals of a score and of a probability: causes with the same columns tie."""

AMPLIFIED = (*EFFORTS, "_a")
"""Endings of readings with an amplifier's noise; that of an encoder is known by its counts."""


@dataclass(frozen=True)
class Price:
    """What was chosen with a candidate.

    Attributes:
        choices: Logarithm of the number of choices that it is one of.
        rare: How many rare things it supposes: an unknown form or what a condition does by no
            channel, and that it changes over time or acts in some of the runs only.
        amplitudes: Score that the amplitudes but the first cost.
    """

    choices: float
    rare: int
    amplitudes: float

    def score(self, numbers: Numbers) -> float:
        """Return the score that these choices cost."""
        return (
            numbers.cause_cost
            + numbers.rare_cost * self.rare
            + numbers.choice_price * self.choices
            + self.amplitudes
        )


@dataclass(frozen=True)
class Scored:
    """A candidate with its score given a base.

    Attributes:
        candidate: The candidate.
        score: Mean of the families of folds, less the price of what was chosen.
        gain: The same with the price left in.
        price: What was chosen.
        amplitudes: Its amplitudes on all runs, in the scale of its columns.
        by_run: Products of its columns, with the base's residual as the target.
    """

    candidate: Candidate
    score: float
    gain: float
    price: Price
    amplitudes: FloatArray
    by_run: Products

    @property
    def is_possible(self) -> bool:
        """Whether its amplitudes are within their bounds."""
        return is_possible(self.candidate.cause, self.amplitudes / self.candidate.size)


def assessed(joint: Joint, pool: Sequence[Group], folds: Folds) -> list[Scored]:
    """Return the score of each candidate given the base; impossible amplitudes are left out."""
    return [one for one in tried(joint, pool, folds) if one.is_possible]


def tried(joint: Joint, pool: Sequence[Group], folds: Folds) -> list[Scored]:
    """Return the score of each candidate given the base, whatever its amplitudes.

    A declared amplitude that the base holds at its bound may rise from it next to a candidate.
    """
    usual = _Usual.of(joint, folds)
    regressions, out = {joint.held.tobytes(): joint}, []
    for group in pool:
        block = block_of(joint, group.laid, group.block)
        judged = _judged(joint, group, block, usual)
        for held, chosen in rising(joint, block, group.precision):
            if held.tobytes() not in regressions:
                regressions[held.tobytes()] = joint.holding(held)
            some = group.only(np.flatnonzero(chosen))
            further = _judged(regressions[held.tobytes()], some, block.only(chosen), usual)
            judged = judged.or_better(further, chosen, joint.held & ~held)
        for k, candidate in enumerate(group.candidates):
            if judged.replaces[k]:
                continue
            amplitudes = judged.amplitudes[k]
            gain, price = round(float(judged.gains[k]), DIGITS), _price(candidate, joint)
            score = gain - price.score(joint.numbers)
            by_run = Products(*(x[:, k] for x in judged.by_run))
            cause = candidate.cause
            if isinstance(cause, Source) and cause.odd:
                candidate = replace(candidate, cause=cause.directed(float(amplitudes[0])))
            out.append(Scored(candidate, score, gain, price, amplitudes, by_run))
    return out


class _Usual(NamedTuple):
    """The base alone: its parameters, and its squared errors on what the folds left out."""

    base: FloatArray
    errors: Sequence[Mapping[Part, FloatArray]]
    spreads: Sequence[Mapping[Part, float]]
    folds: Folds

    @classmethod
    def of(cls, joint: Joint, folds: Folds) -> "_Usual":
        spreads = [extrapolated(joint, family) for family in folds]
        return cls(joint.left_out([[]]).base[0], base_errors(joint, folds), spreads, folds)


class _Judged(NamedTuple):
    """The candidates of a group.

    Attributes:
        gains: Mean of the families of folds, shape (n,).
        amplitudes: On all runs, shape (n, k).
        replaces: Whether one replaces a reading, shape (n,).
        declared: Declared amplitudes next to each, shape (n, declared).
        by_run: Products of the columns in each run.
    """

    gains: FloatArray
    amplitudes: FloatArray
    replaces: NDArray[np.bool_]
    declared: FloatArray
    by_run: Products

    def or_better(
        self, other: "_Judged", chosen: NDArray[np.bool_], freed: NDArray[np.bool_]
    ) -> "_Judged":
        """Return this with what others show of the chosen candidates where that is more.

        The amplitudes that were freed have to be within their bound.
        """
        possible = ~other.replaces & (other.declared[:, freed] >= 0.0).all(axis=1)
        better = possible & (other.gains > np.where(self.replaces, -np.inf, self.gains)[chosen])
        at = np.flatnonzero(chosen)[better]
        made = self._replace(
            gains=self.gains.copy(),
            amplitudes=self.amplitudes.copy(),
            replaces=self.replaces.copy(),
        )
        made.gains[at], made.amplitudes[at] = other.gains[better], other.amplitudes[better]
        made.replaces[at] = False
        return made


def _judged(joint: Joint, group: Group, block: Block, usual: _Usual) -> _Judged:
    outcome = evaluate(joint, block, usual.folds, group.precision, usual.base)
    replaces = _in_readings(joint, group.candidates, outcome) | _turned(joint, group, outcome)
    gains = np.zeros(len(group.candidates))
    if outcome.errors:
        gains[outcome.promising] = score(joint, usual.spreads, usual.errors, outcome.errors)
    return _Judged(gains, outcome.amplitudes, replaces, outcome.declared, outcome.by_run)


def _turned(joint: Joint, group: Group, outcome: Outcome) -> NDArray[np.bool_]:
    """Return which causes give the declared terms a factor that they cannot have, shape (n,).

    One that is not negative would be so in some runs. Or an error of the target would give all
    terms a factor far from one in the runs in which it acts, though these do not follow what the
    others predict: it removes what the equation fits badly.
    """
    found = np.zeros(len(group.candidates), dtype=np.bool_)
    for k, one in enumerate(group.candidates):
        cause, home = one.cause, one.cause.place.home
        if not isinstance(cause, Source) or one.acts is None:
            continue
        at = joint.bounded_at(home, cause.column)
        if at is not None and cause.column is not None:
            column = joint.layout.equations[home].kinds[cause.column]
            unit = column.sign * cause.place.enters[0].gain  # a sensor's gain is a share of it
            change = unit * float(outcome.amplitudes[k, 0] / one.size[0])
            found[k] = outcome.declared[k, at] + change < -TURNED * abs(change)
        if joint.layout.equations[home].target in cause.reads and outcome.promising[k]:
            factor = outcome.factor(k, np.flatnonzero(one.acts))
            is_near = 1.0 / FACTOR <= factor <= FACTOR
            found[k] |= not is_near and joint.unlike(one.acts) > UNEXPLAINED
    return found


def best_of_each(scored: Iterable[Scored]) -> list[Scored]:
    """Return the best candidate of each name, best first."""
    best: dict[object, Scored] = {}
    for one in scored:
        known = best.get(one.candidate.name)
        if known is None or one.score > known.score:
            best[one.candidate.name] = one
    return sorted(best.values(), key=lambda s: -s.score)


def posterior(ranked: Sequence[Scored], numbers: Numbers) -> FloatArray:
    """Return the probability of each candidate, shape (n,); the rest to one is that of no cause."""
    scores, gains = np.array([(s.score, s.gain) for s in ranked]).T
    return probabilities(scores, gains, numbers.sharpness)


def probabilities(scores: FloatArray, gains: FloatArray, sharpness: float) -> FloatArray:
    """Return the probability of each candidate, shape (n,); the rest to one is that of no cause.

    No cause at all has the score zero. What explains nothing has no share: of each weight that of
    the same candidate without its gain, the score before its price, is taken off. The sharpness is
    the log odds for one unit of score.
    """
    top = float(max(0.0, *scores))
    explains = -np.expm1(-sharpness * np.maximum(gains, 0.0))
    weights = np.exp(sharpness * (scores - top)) * explains
    return np.asarray(weights / (weights.sum() + np.exp(-sharpness * top)))


def _in_readings(
    joint: Joint, candidates: Sequence[Candidate], outcome: Outcome
) -> NDArray[np.bool_]:
    """Count errors in the unit of an equation's readings, and return who replaces the largest.

    The residual may be a reading's noise, as much of it as other equations allow. Who reads the
    same quantity through another sensor then shares the task with it and halves the noise, with
    nothing to do with a cause: the factor of the reading becomes smaller, by as much as the noise
    is less seen. That holds of the largest reading, and of all that have an amplifier's noise. Who
    reads such a reading itself may do so by its slope within runs. And who reads the target itself
    has no use for the declared terms; a cause comes in addition to them. A declared term whose
    factor moved reads what the base reads, with another factor, so none of this holds for it.
    Shape (n,).
    """
    replaces = np.zeros(len(candidates), dtype=np.bool_)
    moved = np.array([one.cause.is_declared for one in candidates])
    for name, slopes in outcome.slopes.items():
        unit = np.ones(len(candidates))
        largest = joint.largest_linear.get(name)
        for k, (at, channel) in enumerate(joint.linear(name).items()):
            is_amplified = channel.endswith(AMPLIFIED)
            if not is_amplified and at != largest:
                continue
            change, share = outcome.changes[name][:, k], joint.noise_in_error[name][at]
            seen = np.ones(len(candidates))
            alone = np.array([{*one.cause.reads} == {channel} for one in candidates])
            if is_amplified:
                reads = np.array([channel in one.cause.reads for one in candidates])
                seen[alone] = slopes[alone, k]
                seen[~reads] = change[~reads]
            if at == largest:
                other = ~alone
                if origin_of(channel)[1]:  # a speed or an acceleration: no motion reads the target
                    other &= np.array([_reads_effort(joint, name, one) for one in candidates])
                seen = np.where(other, np.minimum(seen, change), seen)
                replaces |= other & (change < 1.0 / MOST_CHANGE)
            left = 1.0 - share + share * np.clip(seen, 1e-3, 1.0) ** 2
            unit = np.maximum(unit, np.where(moved, 1.0, 1.0 / left))
        for family in outcome.errors:
            family[name, "within"][:] *= unit[outcome.promising]
    replaces[moved] = False
    return replaces


def _reads_effort(joint: Joint, equation: str, candidate: Candidate) -> bool:
    """Whether a cause reads an effort or the target, as such or predicted."""
    target = joint.layout.equations[equation].target
    return any(c == target or c.endswith(AMPLIFIED) for c in candidate.cause.reads)


def is_possible(cause: Source | Function, amplitudes: FloatArray) -> bool:
    """Whether amplitudes of a cause, shape (k,), are within the bounds of their sum."""
    if isinstance(cause, Function):
        return True
    total = float(np.sum(amplitudes[: len(cause.parts)]))  # a bend comes after them
    return cause.least <= abs(total) <= cause.most and not (cause.is_bounded and total < 0.0)


def _price(candidate: Candidate, joint: Joint) -> Price:
    """Return the choices made: the logarithm of how many there were, and what is rare.

    The prior probability of a cause is shared by all forms at all places, that of a form by the
    points of its grid, that of an unknown form by the sets of variables, and that of acting in some
    of the runs by how often it comes or goes and by all choices of when. Each amplitude but the
    first costs what a parameter costs in the Bayesian information criterion (Schwarz 1978).
    """
    choices, cause = float(np.log(candidate.choices)), candidate.cause
    samples = joint.numbers.samples_a_run * len(joint.runs)
    more = 0 if isinstance(cause, Function) else len(cause.parts) - 1
    changes = isinstance(cause, Function) and "time" in cause.variables
    chosen = candidate.acts is not None and not candidate.given
    if candidate.acts is not None and chosen:
        turns = len(candidate.acts) - 1
        changes_at = sum(a != b for a, b in itertools.pairwise(candidate.acts))
        choices += math.log(2 * (turns + 1) * math.comb(turns, changes_at))
    of_condition = isinstance(cause, Source) and "condition" in cause.effect.roles
    rare = int(candidate.is_function or of_condition) + int(changes or chosen)
    return Price(choices, rare, more * float(np.log(samples)) / samples)
