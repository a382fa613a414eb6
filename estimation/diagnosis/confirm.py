"""The confirm runs, opened once: what of a story they bear out."""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from estimation.diagnosis.balance import intervals
from estimation.diagnosis.design import Run
from estimation.diagnosis.frozen import Frozen, freeze, settled, squares
from estimation.diagnosis.gates import Gates
from estimation.diagnosis.story import Claim, Story


def confirmed(story: Story, gates: Gates) -> Story:
    """Freeze, open the confirm runs, and keep the claims they bear out."""
    kept: list[Claim] = []
    refused = list(story.refused)
    last = story.before
    for claim in story.claims:
        trial = freeze(story.balance, [*(c.part for c in kept), claim.part])
        reason = _refusal(last, trial, story.confirm, gates)
        if reason is None and claim.part.map is not None:
            reason = _runs_away(last, trial, story.confirm, gates)
        if reason is None:
            kept.append(claim)
            last = trial
        else:
            refused.append(f"{claim.family}: {reason}")
    kept = _settled(kept, last)
    values = tuple(intervals(story.balance, last.terms, seed=0))
    story = replace(story, claims=tuple(kept), refused=tuple(refused), after=last, values=values)
    return _written(story, gates)


def _settled(claims: Sequence[Claim], last: Frozen) -> list[Claim]:
    """Return the claims, the formula beside each name with the numbers of the joint fit."""
    told = []
    end = len(last.terms) - sum(len(claim.part.terms) for claim in claims)
    for claim in claims:
        end += len(claim.part.terms)
        if claim.form is not None:
            own = last.terms[:end]
            weights = last.weights[: sum(len(term.effect.amplitudes) for term in own)]
            claim = replace(claim, form=claim.form.settled(own, weights))
        told.append(claim)
    return told


def without(story: Story, places: Collection[int]) -> Story:
    """Return a story without some of its claims, and why."""
    claims = tuple(c for k, c in enumerate(story.claims) if k not in places)
    why = "it removes too little to be told from what a larger cause in another balance does here"
    lost = tuple(f"{story.claims[k].family}: {why}" for k in sorted(places))
    return replace(story, claims=claims, refused=(*story.refused, *lost))


def _written(story: Story, gates: Gates) -> Story:
    """Say what a model file holds; a formula that the confirm runs do not bear out is left out."""
    if all(claim.part.map is None for claim in story.claims):
        return replace(story, written=story.after, written_values=story.values)
    kept: list[Claim] = []
    refused = list(story.refused)
    last = story.before
    for claim in story.claims:
        parts = [c.written for c in (*kept, claim)]
        trial = (settled if claim.formulas else freeze)(story.balance, parts)
        reason = _refusal(last, trial, story.confirm, gates) if claim.formulas else None
        if reason is not None:
            refused.append(f"the formula {claim.formulas[0].text}: {reason}")
            kept.append(replace(claim, formulas=()))
            continue
        if claim.formulas:
            best, *others = claim.formulas
            claim = replace(claim, formulas=(best.settled(trial.terms, trial.weights), *others))
        kept.append(claim)
        last = trial
    values = tuple(intervals(last.balance, last.terms, seed=0))
    return replace(
        story, claims=tuple(kept), refused=tuple(refused), written=last, written_values=values
    )


def _refusal(before: Frozen, after: Frozen, confirm: Sequence[Run], gates: Gates) -> str | None:
    """Return why the confirm runs do not bear out what was added, or None where they do."""
    old, new = squares(before, confirm), squares(after, confirm)
    change = 100 * (new.sum() / old.sum() - 1)
    if new.sum() > (1 - gates.floor) * old.sum():
        return f"on the confirm runs the squared error changed by {change:+.1f} %"
    better = int(np.count_nonzero(new < old))
    if better < len(confirm) / 2:
        return f"it helps in {better} of {len(confirm)} confirm runs"
    rise = _rise(before, after, confirm)
    if rise > 0 and change > -100 * gates.in_motion:
        return (
            f"on the confirm runs in motion the squared error changed by {change:+.1f} %, but over"
            f" all samples by {rise:+.1f} %"
        )
    return None


def _runs_away(before: Frozen, after: Frozen, confirm: Sequence[Run], gates: Gates) -> str | None:
    """Return why a map is refused that is wrong where it was not fitted, or None."""
    better = int(np.count_nonzero(squares(after, confirm) < squares(before, confirm)))
    if better <= gates.mapped * len(confirm):
        return f"it helps in {better} of {len(confirm)} confirm runs, and has many columns"
    rise = _rise(before, after, confirm)
    if rise <= 100 * gates.at_rest:
        return None
    return f"on the confirm runs the squared error over all samples changed by {rise:+.1f} %"


def _rise(before: Frozen, after: Frozen, confirm: Sequence[Run]) -> float:
    """Return by how many percent the squared error over all samples rises."""
    old, new = (squares(f, confirm, at_rest=True).sum() for f in (before, after))
    return float(100 * (new / old - 1))
