"""Changes in the order of their probability: what one campaign needs and the other does not."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimation.causes.candidates import Claim, Group, groups_of, laid_out
from estimation.causes.competing import bent
from estimation.causes.criterion import base_errors, extrapolated, score
from estimation.causes.folds import Folds, folds_of
from estimation.causes.joint import Joint
from estimation.causes.layout import Layout
from estimation.causes.ranking import Rank, Ranking
from estimation.causes.scoring import Scored, assessed, best_of_each
from estimation.causes.search import hypothesis
from estimation.changes.candidates import Changed
from estimation.changes.stated import likeliest_first, score_of


def changes_in(
    joint: Joint, pool: Sequence[Group], is_b: Sequence[bool], prior: float
) -> tuple[list[Scored], list[Sequence[Scored]]]:
    """Return the changes of two campaigns, and all that compete in the place of each.

    Args:
        joint: The regression of both without changes.
        pool: What may have changed.
        is_b: Whether each run is of the second campaign.
        prior: Score by which a moved parameter is likelier than another change.
    """
    folds = _folds_of_one_campaign(joint.layout, is_b)
    ranking = Ranking(joint, pool, folds, _in_one_alone(joint, prior))
    best = ranking.next_to([])
    if not best or best[0].score <= 0.0:
        return [], []
    causes, ranked = hypothesis(ranking, best[:1])
    return [_since_the_first(one, is_b, joint) for one in causes], ranked


def _since_the_first(one: Scored, is_b: Sequence[bool], joint: Joint) -> Scored:
    """Return a moved parameter as a change in the second campaign; an effect stays as it is."""
    if not isinstance(one.candidate.cause, Changed):
        return one
    turned = laid_out(joint, Claim(one.candidate.cause, tuple(is_b), given=True))
    return one if turned is None else replace(one, candidate=turned)


def _folds_of_one_campaign(layout: Layout, is_b: Sequence[bool]) -> list[list[list[int]]]:
    """Return families of folds that omit runs of one campaign at a time, never all of it.

    What the declared model lacks at a level is learnt from the other campaign's runs there. A level
    that is all of a campaign shows nothing: its change cannot be fitted without it.
    """
    whole = {side: list(is_b).count(side) for side in (True, False)}
    found = []
    for family in folds_of(layout):
        sided = [
            (side, [run for run in fold if is_b[run] == side]) for fold in family for side in whole
        ]
        if all(len(runs) < whole[side] for side, runs in sided):
            found.append([runs for _, runs in sided if runs])
    return found


def _in_one_alone(plain: Joint, prior: float, reach: float = 7.0) -> Rank:
    """Return the ranking of changes that the campaigns do not share, next to others found.

    The likeliest is first, a moved parameter by `prior` more likely than its score. Another change
    is not tried from log odds of `reach` below the best one.
    """

    def ranked(joint: Joint, pool: Sequence[Group], folds: Folds) -> list[Scored]:
        found: list[Scored] = []
        least = _form_of_others(plain, joint, folds)
        best = best_of_each(assessed(joint, pool, folds))
        for one in best:
            far = bool(found) and one.score < found[0].score - reach / joint.numbers.sharpness
            if one.score < 0.0 or far:
                break
            if one.gain > least and _differs(one, best, joint, folds, prior):
                found.append(one)
        return likeliest_first(found, prior)

    return ranked


def _form_of_others(plain: Joint, joint: Joint, folds: Folds) -> float:
    """Return the gain that the inexact forms of the changes found may have missed.

    Their forms deviate from the catalogue's by a share: the square of it, of the error that they
    remove, does not count as another change.
    """
    spreads = [extrapolated(plain, family) for family in folds]
    removed = score(plain, spreads, base_errors(plain, folds), base_errors(joint, folds))
    left = joint.numbers.bend_share**2 * float(np.expm1(max(0.0, float(removed))))
    return float(-np.log1p(-left)) if left < 1.0 else float("inf")


def _differs(
    one: Scored, every: Sequence[Scored], joint: Joint, folds: Folds, prior: float
) -> bool:
    """Whether a change is worth its price where the same cause acts in both campaigns as well.

    An unknown form is fitted to what the declared model lacks in both. Next to it in both it has to
    be likelier than every named change there, whose form may deviate from its equation.
    """
    shared = laid_out(joint, Claim(one.candidate.cause))
    if one.candidate.cause.is_declared or shared is None:  # in both already
        return True
    both = joint.with_cause(shared.laid, shared.precision)
    changed = Claim(one.candidate.cause, one.candidate.acts, given=True)
    again = assessed(both, groups_of(both, [changed]), folds)
    worth = max((x.gain for x in again), default=0.0) - one.price.score(joint.numbers)
    if worth <= 0.0 or not changed.is_function:
        return worth > 0.0
    forms: list[Claim] = [c for x in every if (c := bent(joint, x)) is not None]
    forms += [x.candidate for x in every if not x.candidate.is_function]
    named = [Claim(c.cause, c.acts, c.choices, given=True) for c in forms]
    rivals = assessed(both, groups_of(both, named), folds)
    return worth >= max((score_of(x, prior) for x in rivals), default=0.0)
