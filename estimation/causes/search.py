"""The search over hypotheses: sets of causes, scored together, extended one cause at a time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from estimation.causes.angles import groups_apart
from estimation.causes.candidates import (
    Claim,
    Group,
    candidates,
)
from estimation.causes.equations import Layout
from estimation.causes.folds import Folds, folds_of
from estimation.causes.joint import Joint
from estimation.causes.nuisances import skews, with_skews
from estimation.causes.numbers import DEFAULT, Numbers
from estimation.causes.ranking import competing
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
        self._rank = rank or competing
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
