"""The search over hypotheses: sets of causes, scored together, extended one cause at a time."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.causes.acting import TURNS, in_other_runs, moved_terms, on_some_runs
from estimation.causes.angles import groups_apart
from estimation.causes.blocks import Products, block_of, errors_of
from estimation.causes.candidates import (
    Candidate,
    Claim,
    Group,
    as_read,
    candidates,
    groups_of,
    laid_out,
)
from estimation.causes.criterion import base_errors, gained
from estimation.causes.folds import Folds, folds_of
from estimation.causes.functions import LOOSE_PLACES, Function
from estimation.causes.grids import RELATIVE, least_order, order_step
from estimation.causes.instruments import stands_for_itself
from estimation.causes.joint import Joint
from estimation.causes.layout import Layout
from estimation.causes.nuisances import noticed, skews, with_skews
from estimation.causes.numbers import DEFAULT, Numbers
from estimation.causes.scoring import DIGITS, Scored, assessed, best_of_each, tried
from estimation.causes.sources import LATE, Bend, Source
from estimation.causes.weights import reweighted
from estimation.effects import Parameter

MOST_CAUSES = 3
"""Causes of one group of equations that share readings."""

KNOTS_OF_BEND, BENT = 5, 24
"""Hat functions of a form's deviation from its equation, and families that are given one."""

REFINED = 8
"""Names whose shapes are refined after the grid, and those whose choices of runs are."""


@dataclass(frozen=True)
class Found:
    """The answer of the search.

    Attributes:
        causes: The leading hypothesis, in the order found; empty when nothing is missing.
        conditional: For each cause, every candidate in its place given the others, best first.
        joint: The regression of the training runs without causes.
        first: Every candidate when nothing is claimed, best first.
        late: Short delays of readings that are part of the base.
        noticed: Angles with such a delay that lowers the error as a cause would; the delay, s.
    """

    causes: Sequence[Scored]
    conditional: Sequence[Sequence[Scored]]
    joint: Joint
    first: Sequence[Scored]
    late: Sequence[Claim]
    noticed: Mapping[str, float]


def search(train: Layout, numbers: Numbers = DEFAULT) -> Found:
    """Find the set of causes that explains training runs best; instruments were added to them."""
    plain = Joint(train, numbers)
    late = skews(plain)
    joint = with_skews(plain, late)
    folds = folds_of(train)
    ranking = Ranking(joint, candidates(joint), folds)
    first = ranking.next_to([])
    causes, conditional = list[Scored](), list[Sequence[Scored]]()
    if first and first[0].score >= 0.0:
        causes, conditional = hypothesis(ranking, _starts(first))
    small = noticed(plain, late, [one.candidate for one in causes], folds)
    return Found(causes, conditional, joint, first, late, small)


def hypothesis(
    ranking: "Ranking", starts: Sequence[Scored]
) -> tuple[list[Scored], list[Sequence[Scored]]]:
    """Return the best set of causes that begins with one, and all that compete with each of it."""
    sets = [_settled(ranking, _chain(ranking, start)) for start in starts]
    return max(sets, key=lambda found: ranking.worth(found[0])) if len(sets) > 1 else sets[0]


Rank = Callable[[Joint, Sequence[Group], Folds], list[Scored]]
"""Regression, candidates and folds to the best candidate of each name, best first."""


class Ranking:
    """Candidates in the order of their scores next to causes that were accepted.

    `rank` ranks the candidates next to a regression's base, the best of each name.
    """

    def __init__(
        self, joint: Joint, pool: Sequence[Group], folds: Folds, rank: Rank | None = None
    ) -> None:
        self.joint, self.folds, self.pool = joint, folds, pool
        self._rank = rank or competing
        self._known: list[tuple[list[object], list[Scored]]] = []

    def next_to(self, causes: Sequence[Scored]) -> list[Scored]:
        """Return the best of each name next to causes, in whatever order they were found."""
        claims = [(one.candidate.cause, one.candidate.acts) for one in causes]
        for known, ranked in self._known:
            if len(known) == len(claims) and all(claim in known for claim in claims):
                return ranked
        ranked = self._rank(self._with(causes), self.pool, self.folds)
        self._known.append(([*claims], ranked))
        return ranked

    def worth(self, causes: Sequence[Scored]) -> float:
        """Return the score of a set as a whole, less the prices of its causes.

        The causes' own scores do not add up to it: each is cautious about the base it was found on.
        """
        after = base_errors(self._with(causes), self.folds)
        prices = [one.price.score(self.joint.numbers) for one in causes]
        return float(gained(self.joint, self.folds, after)) - sum(prices)

    def _with(self, causes: Sequence[Scored]) -> Joint:
        joint = self.joint
        for one in causes:
            candidate, cause = one.candidate, one.candidate.cause
            if isinstance(cause, Source) and cause.odd:  # it is there, its even part too
                whole = replace(cause, odd=False)
                candidate = laid_out(self.joint, Claim(whole, candidate.acts)) or candidate
            joint = joint.with_cause(candidate.laid, candidate.precision)
        return joint


def _starts(ranked: Sequence[Scored]) -> list[Scored]:
    """Return where a chain of causes may begin: the best, and the best of the other kind."""
    other = next(
        (s for s in ranked if s.candidate.is_function != ranked[0].candidate.is_function), None
    )
    if other is None:
        return [ranked[0]]
    # a function explains several named causes of its variables at once, better than each of them
    worth = 0.0 if ranked[0].candidate.is_function else 0.5 * ranked[0].score
    return [ranked[0], other] if other.score > worth else [ranked[0]]


def _chain(ranking: Ranking, start: Scored) -> list[Scored]:
    """Return a set of causes, extended one at a time while another one is worth its price."""
    causes, most = [start], MOST_CAUSES * groups_apart(ranking.joint.layout)
    while len(causes) < most:
        ranked = ranking.next_to(causes)
        if not ranked or ranked[0].score < 0.0:
            break
        causes.append(ranked[0])
    return causes


def _settled(
    ranking: Ranking, causes: Sequence[Scored]
) -> tuple[list[Scored], list[Sequence[Scored]]]:
    """Return causes, each the best next to the others, and what competes in the place of each.

    A cause that is not worth its price next to the others goes, the least first. A cause whose
    shape alone changes is settled: the others are next to much the same.
    """
    settled, conditional = list(causes), list[Sequence[Scored]]([[] for _ in causes])
    for _ in range(MOST_CAUSES):
        before = list(settled)
        for k, cause in enumerate(before):
            # next to the others every candidate may be dropped: the cause then stands as it was
            conditional[k] = ranking.next_to([c for c in settled if c is not settled[k]]) or [cause]
            settled[k] = conditional[k][0]
        if all(_is_as(one, other) for one, other in zip(before, settled, strict=True)):
            break
    least = min(range(len(settled)), key=lambda k: settled[k].score)
    if settled[least].score < 0.0 and len(settled) > 1:
        return _settled(ranking, [*settled[:least], *settled[least + 1 :]])
    return settled, conditional


def _is_as(one: Scored, other: Scored) -> bool:
    """Whether a cause is the same as another but for its shape."""
    return (one.candidate.name, one.candidate.acts) == (other.candidate.name, other.candidate.acts)


def competing(joint: Joint, pool: Sequence[Group], folds: Folds) -> list[Scored]:
    """Return the best of each name: on the grid, on some of the runs, refined, and relaxed."""
    all_runs = tried(joint, pool, folds)
    everything = [s for s in all_runs if s.is_possible]
    known: list[tuple[Claim, Products]] = [(s.candidate, s.by_run) for s in all_runs]
    forms = min((claim.choices for claim, _ in known), default=1)
    known += [(replace(claim, choices=forms), by_run) for claim, by_run in moved_terms(joint)]
    some = best_of_each(assessed(joint, groups_of(joint, on_some_runs(joint, known)), folds))
    climbing = some[:REFINED]
    for _ in range(TURNS):
        flipped = [c for s in climbing for c in in_other_runs(s.candidate)]
        found = best_of_each(assessed(joint, groups_of(joint, flipped), folds))
        before = {s.candidate.name: s.score for s in some}
        climbing = [s for s in found if s.score > before[s.candidate.name]]
        some = best_of_each([*some, *climbing])
    spoilt = assessed(joint, groups_of(joint, reweighted(joint, pool, folds)), folds)
    best = best_of_each([*everything, *some, *spoilt])
    near = [
        c for s in best[:REFINED] for c in (*_neighbours(joint.layout, s.candidate), *_as_late(s))
    ]
    # late by more than a whole reading at every point of the grid: between two of them by one
    near += [c for s in best_of_each(all_runs) if not s.is_possible for c in _as_late(s)]
    best = best_of_each([*best, *assessed(joint, groups_of(joint, near), folds)])
    bent = [c for s in best[:BENT] if (c := _bent(joint, s)) is not None]
    more = assessed(joint, groups_of(joint, bent), folds)
    ranked = _by_reading(joint, best_of_each([*best, *more]), folds)
    return _by_whole_form(joint, ranked, folds)


def _by_reading(joint: Joint, ranked: Sequence[Scored], folds: Folds) -> list[Scored]:
    """Return a ranking in which what depends on the target shows by its reading.

    The estimate of a target that a cause reads has the error that the equation makes, so a function
    of what the equation lacks is one of the estimate too. The cause is fitted with the estimate,
    which has none of the reading's noise, and judged by the reading.
    """
    out = list[Scored]()
    for one in ranked:
        candidate = one.candidate
        read = as_read(joint, candidate) if one.score > 0.0 and _is_of_target(joint, one) else None
        if read is not None:
            fitted, judged = (block_of(joint, laid) for laid in (candidate.laid, read))
            after = errors_of(joint, fitted, folds, candidate.precision[None], judged)
            gain = round(float(gained(joint, folds, after)[0]), DIGITS)
            if gain < one.gain:
                one = replace(one, gain=gain, score=gain - one.price.score(joint.numbers))
        out.append(one)
    return sorted(out, key=lambda one: -one.score)


def _is_of_target(joint: Joint, one: Scored) -> bool:
    """Whether a cause reads a target for which the estimate of its equation stands."""
    cause, run = one.candidate.cause, joint.runs[0]
    return (
        cause.place.kind in LOOSE_PLACES
        and not cause.is_declared
        and any(
            stands_for_itself(run, channel, name)
            for channel in cause.reads
            for name in cause.place.equations
        )
    )


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
        near = [c for s in group for c in (s.candidate, *_neighbours(joint.layout, s.candidate))]
        whole = [
            Claim(replace(c.cause, odd=False), c.acts, c.choices)
            for c in near
            if isinstance(c.cause, Source)
        ]
        found = best_of_each(assessed(joint, groups_of(joint, whole), folds))
        of_name = {one.candidate.name: one for one in found}
        for one in group:
            known = of_name.get(one.candidate.name)
            if known is not None:  # by as much more or less than it has by the odd part
                more = group[0].score + known.score - found[0].score - one.score
                known = replace(one, score=one.score + more, gain=one.gain + more)
            changed[one.candidate.name] = known
    out = [changed.get(one.candidate.name, one) for one in ranked]
    return sorted((one for one in out if one is not None), key=lambda one: -one.score)


def _bent(joint: Joint, one: Scored) -> Claim | None:
    """Return a named effect of one column with a form that deviates from its equation."""
    candidate, cause = one.candidate, one.candidate.cause
    if isinstance(cause, Function) or len(candidate.size) != 1:
        return None
    signals = [cause.values(run) for run in joint.runs]
    values = np.concatenate([x[:, 0] for x in signals if x is not None])
    low, high = np.percentile(values, (1.0, 99.0))
    amplitude = abs(float(one.amplitudes[0] / candidate.size[0]))
    if not high > low or amplitude == 0.0:
        return None
    knots = tuple(float(x) for x in np.linspace(low, high, KNOTS_OF_BEND))
    # to two digits, so that a cause is the same one whatever it was found next to
    bend = Bend(knots, float(f"{joint.numbers.bend_share * amplitude:.1e}"))
    return Claim(replace(cause, bend=bend), candidate.acts, candidate.choices)


def _as_late(one: Scored) -> list[Claim]:
    """Return a late reading at the time at which its size is one: the odd part shows the product.

    A reading is late as a whole.
    """
    cause, candidate = one.candidate.cause, one.candidate
    if isinstance(cause, Function) or cause.effect.id not in LATE:
        return []
    share = float(one.amplitudes[0] / candidate.size[0])
    if share <= 0.0:
        return []
    shape = (*cause.shape[:-1], cause.shape[-1] * share)
    return [Claim(replace(cause, shape=shape), candidate.acts, candidate.choices)]


def _neighbours(layout: Layout, candidate: Candidate) -> list[Claim]:
    """Return a named effect at shapes between the points of the grid."""
    cause = candidate.cause
    if isinstance(cause, Function):
        return []
    out = []
    for k, parameter in enumerate(cause.effect.shape):
        for value in _nearby(layout, cause, k, parameter):
            shape = (*cause.shape[:k], float(value), *cause.shape[k + 1 :])
            out.append(Claim(replace(cause, shape=shape), candidate.acts, candidate.choices))
    return out


def _nearby(layout: Layout, cause: Source, k: int, parameter: Parameter) -> list[float]:
    """Return values of one shape parameter between the points of its grid."""
    if cause.tried:
        return []  # the largest between the points of its grid already
    if parameter.name == "order":
        position = dict(cause.channels)[cause.turning]
        step = order_step(layout, position)
        near = [cause.shape[k] + part * step for part in (-2.0, -1.0, 1.0, 2.0)]
        return [order for order in near if order >= least_order(layout, position)]
    values = RELATIVE.get((cause.effect.id, parameter.name)) or RELATIVE.get(parameter.name)
    if parameter.name in ("width", "settled") or values is None or len(values) < 2:
        return []
    steps, ratio = (-0.5, -0.25, 0.25, 0.5), values[1] / values[0]
    near = [cause.shape[k] * ratio**step for step in steps]
    if parameter.linear:
        near = [cause.shape[k] + step * (values[1] - values[0]) for step in steps]
    if parameter.unit != "1":
        return near
    # a number without a unit has the same bounds on every machine
    return [value for value in near if parameter.lower <= value <= parameter.upper]
