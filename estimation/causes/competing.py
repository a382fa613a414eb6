"""Candidates that compete next to a regression's base: surveyed on their grids, then refined."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.causes.acting import (
    TURNS,
    Promise,
    in_other_runs,
    most_promising,
    moved_terms,
    on_some_runs,
)
from estimation.causes.blocks import Products, block_of, errors_of
from estimation.causes.candidates import Candidate, Claim, Group, as_read, groups_of
from estimation.causes.criterion import gained
from estimation.causes.folds import Folds
from estimation.causes.functions import LOOSE_PLACES, Function, at_other_contacts
from estimation.causes.grids import RELATIVE, axis, between, least_order, order_step
from estimation.causes.instruments import stands_for_itself
from estimation.causes.joint import Joint
from estimation.causes.layout import Layout
from estimation.causes.scoring import DIGITS, Scored, assessed, best_of_each, tried
from estimation.causes.sources import LATE, Bend, Source
from estimation.causes.weights import reweighted
from estimation.effects import Parameter

KNOTS_OF_BEND, BENT = 5, 24
"""Hat functions of a form's deviation from its equation, and families that are given one."""

INSTANTS = tuple(0.5**k for k in range(2, 7))
"""Steps in which the instant of a jump is approached, shares of that of its grid."""

Equations = frozenset[str]
"""Names of the equations that a candidate enters."""

REFINED = 8
"""Names whose shapes are refined after the grid, and those whose choices of runs are."""


@dataclass(frozen=True)
class Survey:
    """Candidates at the points of their grids, next to a regression's base.

    Attributes:
        best: The best of each name, best first.
        beyond: Of the names whose best point has amplitudes beyond their bounds, that point.
        some: Choices of some of the runs, the most promising first.
    """

    best: Sequence[Scored] = ()
    beyond: Sequence[Scored] = ()
    some: Sequence[Promise] = ()


def surveyed(joint: Joint, pool: Sequence[Group], folds: Folds) -> dict[Equations, Survey]:
    """Return the candidates of a pool by the equations that they enter."""
    points, promises = dict[Equations, list[Scored]](), dict[Equations, list[Promise]]()
    scored = tried(joint, pool, folds)
    for one in scored:
        points.setdefault(entered(one.candidate), []).append(one)
    known: list[tuple[Claim, Products]] = [(s.candidate, s.by_run) for s in scored]
    known += [(claim, own) for claim, own in moved_terms(joint) if entered(claim) in points]
    for promise in on_some_runs(joint, known):
        promises.setdefault(entered(promise.claim), []).append(promise)
    return {
        equations: Survey(
            best_of_each(one for one in of_each if one.is_possible),
            [one for one in best_of_each(of_each) if not one.is_possible],
            most_promising(promises.get(equations, [])),
        )
        for equations, of_each in points.items()
    }


def together(surveys: Iterable[Survey]) -> Survey:
    """Return surveys of several sets of equations as one."""
    of_each = [*surveys]
    return Survey(
        best_of_each(one for survey in of_each for one in survey.best),
        [one for survey in of_each for one in survey.beyond],
        most_promising(one for survey in of_each for one in survey.some),
    )


def refined(joint: Joint, pool: Sequence[Group], folds: Folds, survey: Survey) -> list[Scored]:
    """Return the best of each name: of a survey, on some of the runs, refined, and relaxed."""
    # a declared term is one of the forms, as each effect is at a single point
    forms = min((c.choices for group in pool for c in group.candidates), default=1)
    chosen = [
        Claim(p.claim.cause, tuple(p.acts.tolist()), max(p.claim.choices, forms))
        for p in survey.some
    ]
    some = best_of_each(assessed(joint, groups_of(joint, chosen), folds))
    climbing = some[:REFINED]
    for _ in range(TURNS):
        flipped = [c for s in climbing for c in in_other_runs(s.candidate)]
        found = best_of_each(assessed(joint, groups_of(joint, flipped), folds))
        before = {s.candidate.name: s.score for s in some}
        climbing = [s for s in found if s.score > before[s.candidate.name]]
        some = best_of_each([*some, *climbing])
    spoilt = assessed(joint, groups_of(joint, reweighted(joint, pool, folds)), folds)
    best = best_of_each([*survey.best, *some, *spoilt])
    # late by more than a whole reading at every point of the grid: between two of them by one
    near = [c for s in (*best[:REFINED], *survey.beyond) for c in _as_late(s)]
    near += [c for s in best[:REFINED] for c in _neighbours(joint.layout, s.candidate)]
    while near:
        before = {s.candidate.name: s.score for s in best}
        found = best_of_each(assessed(joint, groups_of(joint, near), folds))
        best = best_of_each([*best, *found])
        # the shape of an effect is fitted at the end, that of an unknown form is not
        better = [
            s for s in found if s.candidate.is_function and s.score > before[s.candidate.name]
        ]
        near = [c for s in better for c in _neighbours(joint.layout, s.candidate)]
    for part in INSTANTS:
        shown = [s.candidate for s in best[:REFINED] if s.gain > 0.0]
        jumps = [c for one in shown for c in _at_other_instants(joint.layout, one, part)]
        best = best_of_each([*best, *assessed(joint, groups_of(joint, jumps), folds)])
    free = [c for s in best[:BENT] if (c := bent(joint, s)) is not None]
    more = assessed(joint, groups_of(joint, free), folds)
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


def bent(joint: Joint, one: Scored) -> Claim | None:
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


def _at_other_instants(layout: Layout, candidate: Candidate, part: float) -> list[Claim]:
    """Return an effect that begins at an instant so much earlier and later, of a step of its grid.

    A jump has no slope by its time, so no fit moves it.
    """
    cause = candidate.cause
    if isinstance(cause, Function):
        return []
    out = []
    for k, parameter in enumerate(cause.effect.shape):
        if parameter.name != "since" or cause.tried:
            continue
        points = axis(layout, cause.place, cause.effect, parameter, dict(cause.channels))
        for step in (-part, part):
            value = cause.shape[k] + step * (points[1] - points[0])
            shape = (*cause.shape[:k], value, *cause.shape[k + 1 :])
            out.append(Claim(replace(cause, shape=shape), candidate.acts, candidate.choices))
    return out


def _neighbours(layout: Layout, candidate: Candidate) -> list[Claim]:
    """Return a cause at shapes between the points of the grid."""
    cause, out = candidate.cause, list[Claim]()
    if isinstance(cause, Function):
        near = at_other_contacts(layout, cause)
        return [Claim(function, candidate.acts, candidate.choices) for function in near]
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
    near = between(values, cause.shape[k], parameter.linear)
    if parameter.unit != "1":
        return near
    # a number without a unit has the same bounds on every machine
    return [value for value in near if parameter.lower <= value <= parameter.upper]


def entered(claim: Claim) -> Equations:
    """Return the equations that a cause enters."""
    return frozenset(claim.cause.place.equations)
