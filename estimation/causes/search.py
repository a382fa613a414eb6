"""The search over hypotheses: sets of causes, scored together, extended one cause at a time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from estimation.causes.angles import groups_apart
from estimation.causes.candidates import Claim, candidates
from estimation.causes.folds import folds_of
from estimation.causes.joint import Joint
from estimation.causes.layout import Layout
from estimation.causes.nuisances import noticed, skews, with_skews
from estimation.causes.numbers import DEFAULT, Numbers
from estimation.causes.ranking import Ranking
from estimation.causes.scoring import Scored

MOST_CAUSES = 3
"""Causes of one group of equations that share readings."""


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
    ranking: Ranking, starts: Sequence[Scored]
) -> tuple[list[Scored], list[Sequence[Scored]]]:
    """Return the best set of causes that begins with one, and all that compete with each of it."""
    sets = [_settled(ranking, _chain(ranking, start)) for start in starts]
    return max(sets, key=lambda found: ranking.worth(found[0])) if len(sets) > 1 else sets[0]


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
