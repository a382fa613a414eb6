"""Which experiment tells rivals apart: where one rival, fitted, cannot be imitated by another.

For each experiment on a menu the declared rig is simulated. Rival A, fitted on the runs there are,
says what the target would be there; rival B is then refitted on old and new runs together. What B
cannot absorb on the new runs, over the noise, is the experiment's worth for that pair; for all
rivals it is that of the worst pair (Atkinson and Fedorov, Biometrika 62, 1975: T-optimality).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate, pool
from estimation.diagnosis.design import Run, targets
from estimation.diagnosis.least_squares import least_squares
from estimation.diagnosis.result import Finding
from estimation.diagnosis.story import Story
from estimation.recording import FloatArray

COST_PER_MINUTE = 0.01
"""Worth that a minute at the rig must add: a hundredth of the noise's variance."""

MOST_RIVALS = 4
NEAR = 0.5
"""Without a name, families with this share of the best one's gain are the rivals."""

POINTS = 24
"""Shapes of a family that are tried where the search kept none."""


@dataclass(frozen=True)
class Worth:
    """What one experiment would tell.

    Attributes:
        name: Name of the experiment.
        seconds: Time at the rig.
        pairs: Fitted rival and the one that would imitate it, to the mean squared difference that
            is left, over the variance of the noise.
    """

    name: str
    seconds: float
    pairs: Mapping[tuple[str, str], float]

    @property
    def discrimination(self) -> float:
        """That of the pair that is told apart worst."""
        return min(self.pairs.values())

    @property
    def net(self) -> float:
        """Discrimination less the cost of the time."""
        return self.discrimination - COST_PER_MINUTE * self.seconds / 60.0


def rivals_of(story: Story, finding: Finding, measured: Sequence[str]) -> list[Candidate]:
    """Return the effects that a finding may be, at their best shapes; fewer than two if it is one.

    Args:
        story: The story of the finding's balance.
        finding: The finding.
        measured: Channels that every run has.
    """
    if finding.verdict == "identified":
        return []
    if finding.verdict == "one_of":
        families = [finding.family, *finding.alternatives]
    else:
        best = max((t.gain for t in story.discovery.ranking), default=0.0)
        families = [t.family for t in story.discovery.ranking if t.gain >= NEAR * best]
    kept = {n.candidate.family: n.candidate for n in story.discovery.named}
    ranked = {t.family: t.candidates[0] for t in story.discovery.ranking}
    balance = story.balance
    offered = pool(balance.model, measured)
    found = []
    for family in families[:MOST_RIVALS]:
        one = kept.get(family) or ranked.get(family) or _best(balance, family, offered)
        if one is not None:
            found.append(one)
    return found


def beside(story: Story, finding: Finding) -> list[Candidate]:
    """Return what the rivals stand beside: declared effects and what else was found."""
    parts = [c.part.candidate for c in story.claims]
    others = [c for c in parts if c is not None and c.family != finding.family]
    return [*story.balance.terms, *others]


def worth(
    balance: Balance,
    terms: Sequence[Candidate],
    rivals: Sequence[Candidate],
    name: str,
    new: Sequence[Run],
    seconds: float,
) -> Worth:
    """Say what an experiment would tell of rivals.

    Args:
        balance: The balance on the runs there are.
        terms: Effects beside the rivals.
        rivals: Two at least.
        name: Name of the experiment.
        new: Its simulated runs, prepared as the old ones.
        seconds: Its time at the rig.
    """
    both = replace(
        balance,
        runs=[*balance.runs, *new],
        target=[*balance.target, *targets(new, balance.model)],
        tables_of={},
    )
    old = len(balance.runs)
    noise = min(balance.loss([*terms, r]) for r in rivals) / sum(len(y) for y in balance.target)
    truths, spans = {}, {}
    for rival in rivals:
        weights = balance.solve([*terms, rival])
        truths[rival.family] = [c @ weights for c in both.columns([*terms, rival])]
    for rival in rivals:
        spans[rival.family] = both.base([*terms, rival])
    pairs = {
        (a.family, b.family): _left(truths[a.family], spans[b.family], old) / max(noise, 1e-300)
        for a in rivals
        for b in rivals
        if a.family != b.family
    }
    return Worth(name, seconds, pairs)


def _left(truth: Sequence[FloatArray], span: Sequence[FloatArray], old: int) -> float:
    """Return the mean square that columns leave of a truth on the runs after the first `old`."""
    whole, aim = np.vstack(list(span)), np.concatenate(list(truth))
    weights = least_squares(whole, aim)
    error = np.concatenate([y - c @ weights for y, c in zip(truth[old:], span[old:], strict=True)])
    return float(np.mean(error**2))


def _best(balance: Balance, family: str, offered: Sequence[Candidate]) -> Candidate | None:
    own = [c for c in offered if c.family == family]
    if not own:
        return None
    places = np.unique(np.linspace(0, len(own) - 1, POINTS).round().astype(int))
    tried = [own[int(k)] for k in places]
    return min(tried, key=lambda c: balance.loss([*balance.terms, c]))
