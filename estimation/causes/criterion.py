"""The one criterion: how much better what folds left out is predicted.

A cause has the score by which the logarithm of the squared error falls on runs, and on levels of
the conditions, that took no part in the fit.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from estimation.causes.folds import Folds
from estimation.causes.joint import Family, Joint
from estimation.causes.laid import TINY, Part
from estimation.recording import FloatArray


def base_errors(joint: Joint, folds: Folds) -> Sequence[Mapping[Part, FloatArray]]:
    """Return the squared errors of the base on what was left out, one mapping a family."""
    out: list[Mapping[Part, FloatArray]] = []
    for family in folds:
        fits = joint.left_out(family)
        base = fits.base[fits.fold]
        vector = np.column_stack([base, np.full(len(base), -1.0)])
        found = {p: np.zeros(len(joint.runs)) for p in joint.parts}
        for p in joint.parts:
            own = np.einsum("ri,rij,rj->r", vector, joint.gram[p][fits.runs], vector)
            avoided = joint.avoided(p, fits.runs, base[:, None])[:, 0]
            found[p][fits.runs] = np.maximum(own, 0.0) + avoided
        out.append(found)
    return out


def squared_of_runs(joint: Joint, base: FloatArray, part: Part) -> FloatArray:
    """Return the squared error of each run with a base of these parameters, shape (runs,)."""
    vector = np.append(base, -1.0)
    return np.asarray(np.einsum("i,rij,j->r", vector, joint.gram[part], vector))


def extrapolated(joint: Joint, family: Family) -> Mapping[Part, float]:
    """Return the squared error that the base's own uncertainty makes in what was left out."""
    fits = joint.left_out(family)
    return {
        p: float(np.sum(joint.gram[p][fits.runs, :-1, :-1] * fits.inverse[fits.fold]))
        for p in joint.parts
    }


def score(
    joint: Joint,
    spreads: Sequence[Mapping[Part, float]],
    before: Sequence[Mapping[Part, FloatArray]],
    after: Sequence[Mapping[Part, FloatArray]],
) -> FloatArray:
    """Return the scores of candidates, shape (candidates,).

    The score of a part is the mean over families, from the errors of each before and after. A
    family counts by how well the base itself is known where it predicts, which is its spread,
    and at most what the family of single runs shows: where the base extrapolates badly anything
    seems to help.
    """
    total = np.zeros(())
    for p in joint.parts:
        ratios, trusts = [], []
        for spread, old, new in zip(spreads, before, after, strict=True):
            pair = [(e[p].sum(axis=0) + spread[p]) / joint.samples[p].sum() for e in (old, new)]
            ratios.append(log_ratio(joint, p, pair[0], pair[1]))
            whole = float(old[p].sum()) + TINY
            trusts.append(whole / (whole + spread[p]))
        least = [t * np.minimum(r, ratios[0]) for t, r in zip(trusts, ratios, strict=True)]
        total = total + np.sum(least, axis=0) / sum(trusts)
    return np.asarray(total)


def gained(joint: Joint, folds: Folds, after: Sequence[Mapping[Part, FloatArray]]) -> FloatArray:
    """Return the scores of errors on what folds left out against those of the base alone."""
    spreads = [extrapolated(joint, family) for family in folds]
    return score(joint, spreads, base_errors(joint, folds), after)


def log_ratio(
    joint: Joint, part: Part, before: FloatArray | float, after: FloatArray
) -> FloatArray:
    """Return the weighted log ratio of mean squared errors of a part, above its floor."""
    numbers, weight = joint.numbers, 1.0
    floor = numbers.form_floor * joint.error[part]
    if part[1] == "between":
        weight = numbers.between
        floor += numbers.between * joint.error[part[0], "within"]
    return np.asarray(weight * np.log((before + floor) / (after + floor)))
