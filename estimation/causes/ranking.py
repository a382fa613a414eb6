"""Candidates in the order of their scores next to causes that were accepted."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Generic, TypeVar

from estimation.causes.candidates import Claim, Group, groups_of, laid_out
from estimation.causes.competing import (
    BENT,
    Equations,
    Survey,
    entered,
    refined,
    surveyed,
    together,
)
from estimation.causes.criterion import base_errors, gained
from estimation.causes.folds import Folds
from estimation.causes.joint import Joint
from estimation.causes.scoring import Scored, assessed, best_of_each
from estimation.causes.sources import Source

Rank = Callable[[Joint, Sequence[Group], Folds], list[Scored]]
"""Regression, candidates and folds to the best candidate of each name, best first."""

Kept = TypeVar("Kept")


class _NextTo(Generic[Kept]):
    """What was worked out next to sets of causes, in whatever order these were found."""

    def __init__(self) -> None:
        self._of: list[tuple[list[object], Kept]] = []

    def next_to(self, causes: Sequence[Scored]) -> Kept | None:
        """Return the result next to causes; None where there is none yet."""
        claims = _claims(causes)
        for known, kept in self._of:
            if len(known) == len(claims) and all(claim in known for claim in claims):
                return kept
        return None

    def add(self, causes: Sequence[Scored], kept: Kept) -> None:
        """Keep what was worked out next to causes."""
        self._of.append((_claims(causes), kept))


def _claims(causes: Sequence[Scored]) -> list[object]:
    """Return the causes and the runs in which they act."""
    return [(one.candidate.cause, one.candidate.acts) for one in causes]


class Ranking:
    """Candidates in the order of their scores next to causes that were accepted.

    `rank` ranks the candidates next to a regression's base, the best of each name. Without it all
    compete. A candidate is surveyed again where a cause is new that shares an equation with it;
    what lies elsewhere barely matters to it, and of those that were surveyed before only the best
    are judged again.
    """

    def __init__(
        self, joint: Joint, pool: Sequence[Group], folds: Folds, rank: Rank | None = None
    ) -> None:
        self.joint, self.folds, self.pool = joint, folds, pool
        self._rank = rank
        self._known = _NextTo[list[Scored]]()
        self._surveys: dict[Equations, _NextTo[Survey]] = {
            entered(group.candidates[0]): _NextTo() for group in pool
        }

    def next_to(self, causes: Sequence[Scored]) -> list[Scored]:
        """Return the best of each name next to causes, in whatever order they were found."""
        if (known := self._known.next_to(causes)) is not None:
            return known
        joint = self._with(causes)
        if self._rank is not None:
            ranked = self._rank(joint, self.pool, self.folds)
        else:
            ranked = refined(joint, self.pool, self.folds, self._survey(joint, causes))
        self._known.add(causes, ranked)
        return ranked

    def _survey(self, joint: Joint, causes: Sequence[Scored]) -> Survey:
        """Return every candidate next to causes, known ones as they were next to fewer of them."""
        near = {
            equations: [one for one in causes if equations & entered(one.candidate)]
            for equations in self._surveys
        }
        carried = {e: self._surveys[e].next_to(near[e]) for e in near}
        pool = [group for group in self.pool if carried[entered(group.candidates[0])] is None]
        fresh = surveyed(joint, pool, self.folds)
        for equations, survey in fresh.items():
            self._surveys[equations].add(near[equations], survey)
        known = together(survey for survey in carried.values() if survey is not None)
        again = [one.candidate for one in known.best[:BENT]]
        best = best_of_each(assessed(joint, groups_of(joint, again), self.folds))
        known = replace(known, best=[*best, *known.best[BENT:]])
        return together([known, *fresh.values()])

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
