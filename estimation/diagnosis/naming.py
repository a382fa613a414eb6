"""Naming: what else each effect found could be, how sure its name is, and what is left."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimation.diagnosis.bent import bent_losses
from estimation.diagnosis.candidate import Candidate, related
from estimation.diagnosis.evidence import Losses, leave_one_run_out, resampled, runs_agree
from estimation.diagnosis.maps import Map, best_map, variables_of, within
from estimation.diagnosis.search import Search, Trial
from estimation.recording import FloatArray


@dataclass(frozen=True)
class Named:
    """An effect that passed every gate on the runs that discover.

    Attributes:
        candidate: The effect at its refined shape.
        trial: The step that found it.
        gain: Share of squared error it removes beside all others, runs left out.
        rivals: Families that cannot be told from it on these runs, best first.
        confidence: Share of run bootstraps in which it leaves the least error, times the chances
            that the gain is real (max statistic) and general (signed ranks). Not calibrated.
        veto: The map that withdraws its name, or None.
    """

    candidate: Candidate
    trial: Trial
    gain: float
    rivals: tuple[str, ...] = ()
    confidence: float = 0.0
    veto: Map | None = None


@dataclass(frozen=True)
class Discovery:
    """What the runs that discover say about one balance.

    Attributes:
        named: Effects found, in order.
        steps: The best trial of each step, the last one the one that failed.
        ranking: First step's families, best first.
        left_map: Best map of what is left after all, or None.
    """

    named: tuple[Named, ...]
    steps: tuple[Trial, ...]
    ranking: tuple[Trial, ...]
    left_map: Map | None


def searched(search: Search) -> Discovery:
    """Search forwards, in pairs, and backwards; then ask what else each effect could be."""
    found, trials, steps, ranking = search.forwards()
    kept = search.backwards(found)
    stay = [found[j] for j in kept]
    for k in range(len(stay)):
        stay[k] = _swapped(search, stay, k)
    named = [_named(search, stay, k, trials[j]) for k, j in enumerate(kept)]
    stays = [n.candidate for n in named if n.veto is None]
    terms = [*search.balance.terms, *stays]
    left = best_map(search.balance, terms, search.gates.draws, search.seed)
    return Discovery(tuple(named), tuple(steps), tuple(ranking), left)


def _named(search: Search, found: Sequence[Candidate], k: int, trial: Trial) -> Named:
    """Ask what else an effect could be, how sure its name is, and whether a map does better."""
    others = [f for j, f in enumerate(found) if j != k]
    mine = search.beside(found, range(len(found)), k)
    own, gain = mine.joint[:, 0, 0], float(mine.gain[0, 0])
    total = mine.base[:, 0]
    offered = _rivals(search, others, found[k], gain)
    rivals = {r.family: _losses_beside(search, others, r) for r in offered}
    bent = _bent(search, others, [found[k], *offered])
    near: dict[str, FloatArray] = {}
    for rival, loosely in zip(offered, bent[1:], strict=True):
        losses, against = rivals[rival.family], own
        clearly = 1.0
        if not _alike(rival, found[k]):
            losses, against, clearly = loosely, bent[0], search.gates.clearly
        enough = 1 - losses.sum() / total.sum() >= search.gates.rival * gain
        proved = runs_agree(total, losses) <= search.gates.agree
        beaten = against.sum() < clearly * losses.sum()
        beaten &= runs_agree(losses, against) <= search.gates.agree
        if enough and proved and not beaten:
            near[rival.family] = rivals[rival.family]
    terms = [*search.balance.terms, *others]
    flat = best_map(search.balance, terms, 0, search.seed)
    better = (
        flat is not None
        and flat.variables != found[k].effect.any_function_of
        and _vetoes(search, flat, mine)
        and not _of_its_form(search, found[k], gain, flat)
    )
    return Named(
        found[k],
        trial,
        gain,
        tuple(sorted(near, key=lambda f: float(near[f].sum()))),
        _wins(own, list(rivals.values()), search.seed) * (1 - trial.p) * (1 - trial.agree),
        flat if better else None,
    )


def _rivals(
    search: Search, others: Sequence[Candidate], named: Candidate, gain: float
) -> list[Candidate]:
    """Return the other families that could do it, each at its own best shape, best first."""
    found: list[Candidate] = []
    for rival in search.ranked(others, 0):
        if rival.family == named.family or len(found) == 8:
            continue
        if rival.gain >= 0.8 * search.gates.rival * gain:
            best = _polished(search, others, rival.candidates[0])
            if search.shows(best):
                found.append(best)
    return found


def _swapped(search: Search, found: Sequence[Candidate], k: int) -> Candidate:
    """Return an effect, or the one of other variables that does clearly better in any form."""
    others = [f for j, f in enumerate(found) if j != k]
    mine = search.beside(found, range(len(found)), k)
    offered = [
        r
        for r in _rivals(search, others, found[k], float(mine.gain[0, 0]))
        if not _alike(r, found[k]) and not any(related(r, f) for f in others)
    ]
    if not offered:
        return found[k]
    own, *losses = _bent(search, others, [found[k], *offered])
    best = min(range(len(offered)), key=lambda i: float(losses[i].sum()))
    clearly = losses[best].sum() <= search.gates.veto * own.sum()
    if clearly and runs_agree(own, losses[best]) <= search.gates.agree:
        return offered[best]
    return found[k]


def _alike(first: Candidate, second: Candidate) -> bool:
    """Say whether two effects depend on the same channels: only their form tells them apart."""
    one, other = ({name for _, name in c.channels} for c in (first, second))
    return one == other


def _bent(
    search: Search, others: Sequence[Candidate], offered: Sequence[Candidate]
) -> list[FloatArray]:
    """Return the losses of each run left out, shape (runs,), of effects that may bend."""
    terms = [*search.balance.terms, *others]
    left = search.balance.left(terms)
    return [bent_losses(search.balance, terms, c, left).joint[:, 0, 0] for c in offered]


def _polished(search: Search, others: Sequence[Candidate], rival: Candidate) -> Candidate:
    """Return a rival at its own best shape."""
    if not rival.shape:
        return rival
    return search.balance.refined([*search.balance.terms, *others, rival], passes=1)[-1]


def _losses_beside(search: Search, others: Sequence[Candidate], rival: Candidate) -> FloatArray:
    """Return the losses of each run left out with a rival in the winner's place."""
    terms = [*search.balance.terms, *others]
    block = search.balance.columns([rival])
    aims = [r[:, None] for r in search.balance.left(terms)]
    base = search.balance.base(terms)
    joint = leave_one_run_out(base, block, [block[0].shape[1]], aims).joint
    losses: FloatArray = joint[:, 0, 0]
    return losses


def _of_its_form(search: Search, named: Candidate, gain: float, flat: Map) -> bool:
    """Say whether a map only bends a name's formula: its variables, and little more gain."""
    own = within(flat.variables, variables_of(named, search.balance))
    return own and gain >= search.gates.form * flat.gain


def _vetoes(search: Search, flat: Map, mine: Losses) -> bool:
    """Say whether a map predicts runs left out clearly better than the named effect."""
    # a map sees every second sample, so shares of its own base are compared
    share = mine.joint[:, 0, 0] / mine.base[:, 0]
    other = flat.losses / flat.base_losses
    pooled = flat.losses.sum() / flat.base_losses.sum()
    named = mine.joint[:, 0, 0].sum() / mine.base[:, 0].sum()
    clearly = pooled < search.gates.veto * named
    worth = (named - pooled) * mine.base[:, 0].sum() >= search.floor
    return bool(clearly and worth and runs_agree(share, other) <= search.gates.agree)


def _wins(own: FloatArray, rivals: Sequence[FloatArray], seed: int, count: int = 500) -> float:
    """Return the share of run bootstraps in which the winner leaves the least error."""
    if not rivals:
        return 1.0
    weights = resampled(len(own), count, seed)
    best = np.min([weights @ losses for losses in rivals], axis=0)
    return float(np.mean(weights @ own < best))
