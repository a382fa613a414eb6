"""Which changes compete: those that one campaign needs and the other does not."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimation.causes.candidates import Claim, Group, groups_of, laid_out
from estimation.causes.equations import Layout
from estimation.causes.folds import Folds, folds_of
from estimation.causes.joint import Joint
from estimation.causes.scoring import Scored, assessed, best_of_each
from estimation.causes.search import Rank

OUT_OF_REACH = 7.0
"""Log odds below the best change from which another one is not looked at."""


def folds_of_one_campaign(layout: Layout, is_b: Sequence[bool]) -> list[list[list[int]]]:
    """Return families of folds that omit runs of one campaign at a time.

    What the declared model lacks at a level is learnt from the other campaign's runs there.
    """
    return [
        [of_one for fold in family for side in (True, False) if (of_one := _of(fold, is_b, side))]
        for family in folds_of(layout)
    ]


def _of(fold: Sequence[int], is_b: Sequence[bool], side: bool) -> list[int]:
    return [run for run in fold if is_b[run] == side]


def in_one_alone(plain: Joint) -> Rank:
    """Return the ranking of changes that the campaigns do not share, next to others found.

    Args:
        plain: The regression without changes.
    """

    def ranked(joint: Joint, pool: Sequence[Group], folds: Folds) -> list[Scored]:
        found: list[Scored] = []
        least = _form_of_others(plain, joint, folds)
        for one in best_of_each(assessed(joint, pool, folds)):
            reach = OUT_OF_REACH / joint.numbers.sharpness
            if one.score < 0.0 or (found and one.score < found[0].score - reach):
                break
            if one.gain > least and _differs(one, joint, folds):
                found.append(one)
        return found

    return ranked


def _form_of_others(plain: Joint, joint: Joint, folds: Folds) -> float:
    """Return the gain that the inexact forms of the changes found may have missed.

    Their forms deviate from the catalogue's by a share: the square of it, of the error that they
    remove, does not count as another change.
    """
    spreads = [plain.extrapolated(family) for family in folds]
    removed = plain.score(spreads, plain.base_errors(folds), joint.base_errors(folds))
    left = joint.numbers.bend_share**2 * float(np.expm1(max(0.0, float(removed))))
    return float(-np.log1p(-left)) if left < 1.0 else float("inf")


def _differs(one: Scored, joint: Joint, folds: Folds) -> bool:
    """Whether a change is worth its price where the same cause acts in both campaigns as well."""
    shared = laid_out(joint, Claim(one.candidate.cause))
    if shared is None:  # a declared column
        return True
    both = joint.with_cause(shared.laid, shared.precision)
    changed = replace(Claim(one.candidate.cause), acts=one.candidate.acts, given=True)
    again = assessed(both, groups_of(both, [changed]), folds)
    return bool(again) and again[0].gain > one.gain - one.score
