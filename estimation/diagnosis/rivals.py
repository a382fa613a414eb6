"""Rivals: which other effects could do what a named one does, and which of them are beaten.

Of two effects of the same channels the form decides. Of two that depend on different channels each
is given any form a little bent, and the one that is clearly better then has the name.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimation.diagnosis.bent import bent_losses
from estimation.diagnosis.candidate import Candidate, related
from estimation.diagnosis.evidence import Losses, losses_of, runs_agree
from estimation.diagnosis.least_squares import told_beyond
from estimation.diagnosis.search import Search
from estimation.recording import FloatArray

MOST = 8
"""Rivals that are looked at."""

ROUGHLY = 0.8
"""Share of the least gain of a rival above which it is worth polishing."""

ALIKE = 0.9
"""Squared cosine of what two effects add above which they do the same on these runs."""


@dataclass(frozen=True)
class Beside:
    """What stands beside a named effect, laid out once for it and all its rivals.

    Attributes:
        others: The other effects found.
        base: What is refitted, of each run.
        left: What that leaves of each run, shape (n,).
    """

    others: Sequence[Candidate]
    base: Sequence[FloatArray]
    left: Sequence[FloatArray]

    @classmethod
    def of(cls, search: Search, others: Sequence[Candidate]) -> "Beside":
        """Lay out the declared effects and others."""
        terms = [*search.balance.terms, *others]
        return cls(others, search.balance.base(terms), search.balance.left(terms))


@dataclass(frozen=True)
class Tried:
    """An effect in the place of a named one, beside all others that were found.

    Attributes:
        candidate: The effect at its own best shape.
        plain: Losses without it and with it.
        bent: Squared error of each run left out in any form a little bent, shape (runs,).
        added: What it adds that nothing beside it does, over all runs, shape (n,).
        shown: Whether the runs show it as what it is.
    """

    candidate: Candidate
    plain: Losses
    bent: FloatArray
    added: FloatArray
    shown: bool = True

    @property
    def losses(self) -> FloatArray:
        """Squared error of each run left out, shape (runs,)."""
        return self.plain.joint[:, 0, 0]

    def depends_as(self, other: "Tried") -> bool:
        """Say whether two effects depend on the same channels: only their form tells them apart."""
        one, two = ({name for _, name in t.candidate.channels} for t in (self, other))
        return one == two

    def does_as(self, other: "Tried") -> bool:
        """Say whether two effects do the same on these runs."""
        size = float(self.added @ self.added) * float(other.added @ other.added)
        return float(self.added @ other.added) ** 2 >= ALIKE * size > 0


def tried(search: Search, beside: Beside, candidate: Candidate, shown: bool = True) -> Tried:
    """Put an effect beside others."""
    block = search.balance.columns([candidate])
    plain = losses_of(beside.base, block, beside.left)
    bent = bent_losses(search.balance, beside.base, candidate, beside.left)
    left = np.concatenate(beside.left)
    added = told_beyond(np.vstack(beside.base), np.vstack(block), left)
    return Tried(candidate, plain, bent.joint[:, 0, 0], added, shown)


def rivals_of(search: Search, beside: Beside, named: Candidate, gain: float) -> list[Tried]:
    """Return the other families that could do it, each at its own best shape, best first.

    Args:
        search: The search that found it.
        beside: What stands beside the effect.
        named: The effect.
        gain: Share of the squared error it removes beside the others.
    """
    found: list[Tried] = []
    for rival in search.ranked(beside.others, 0):
        if rival.family == named.family or rival.gain < ROUGHLY * search.gates.rival * gain:
            continue
        best = _polished(search, beside.others, rival.candidates[0])
        shown = search.shows(best) or best.family in named.effect.same_as
        shown = shown and not search.wanders([best], beside.others)
        found.append(tried(search, beside, best, shown))
        if sum(r.shown for r in found) == MOST:
            break
    return found


def with_alike(near: Sequence[Tried], named: Tried, rivals: Sequence[Tried]) -> list[Tried]:
    """Return unbeaten rivals and all that do on these runs what one of them does.

    At one speed friction that grows with the load does what it does when it grows with both: where
    one of the two is possible, so is the other, whether or not the runs show it as what it is.
    """
    found = list(near)
    unbeaten = {rival.candidate for rival in near}
    for rival in rivals:
        if rival.candidate in unbeaten:
            continue
        if any(rival.does_as(one) for one in (named, *found)):
            found.append(rival)
    return found


def _polished(search: Search, others: Sequence[Candidate], rival: Candidate) -> Candidate:
    """Return a rival at its own best shape."""
    if not rival.shape:
        return rival
    return search.balance.refined([*search.balance.terms, *others, rival], passes=1)[-1]


def beaten(search: Search, named: Tried, rival: Tried) -> bool:
    """Say whether a named effect leaves less than a rival in run after run, and not just a little.

    Of effects that only another experiment tells apart neither beats the other. What does nearly
    the same on these runs is told apart by the form alone, and no formula has the true form.
    """
    if named.depends_as(rival):
        if rival.candidate.family in named.candidate.effect.same_as:
            return False
        return runs_agree(rival.losses, named.losses) <= search.gates.agree
    alike = named.does_as(rival)
    share = search.gates.clearly_alike if alike else search.gates.clearly
    enough = named.bent.sum() < share * rival.bent.sum()
    return bool(enough) and runs_agree(rival.bent, named.bent) <= search.gates.agree


def better(
    search: Search, named: Tried, rivals: Sequence[Tried], others: Sequence[Candidate]
) -> Candidate | None:
    """Return the rival that should have the place of a named effect, or None.

    One of other channels that is clearly better in any form; else the likeliest of those that are
    not beaten and better as they are, and in any form where they read other channels.
    """
    offered = [r for r in rivals if not any(related(r.candidate, f) for f in others)]
    others_best = min(
        (r for r in offered if not r.depends_as(named)),
        key=lambda r: float(r.bent.sum()),
        default=None,
    )
    if (
        others_best is not None
        and others_best.bent.sum() <= search.gates.veto * named.bent.sum()
        and runs_agree(named.bent, others_best.bent) <= search.gates.agree
    ):
        return others_best.candidate
    likelier = [
        r
        for r in offered
        if r.losses.sum() < named.losses.sum()
        and (r.depends_as(named) or r.bent.sum() < named.bent.sum())
        and not beaten(search, named, r)
    ]
    best = min(likelier, key=lambda r: float(r.losses.sum()), default=None)
    return best.candidate if best is not None else None
