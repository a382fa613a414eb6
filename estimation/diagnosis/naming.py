"""Naming: what else each effect found could be, how sure its name is, and what is left."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.evidence import Losses, losses_of, resampled, runs_agree
from estimation.diagnosis.maps import Map, best_map
from estimation.diagnosis.rivals import Beside, Tried, beaten, better, rivals_of, tried, with_alike
from estimation.diagnosis.search import Search, Trial
from estimation.diagnosis.steps import backwards, forwards
from estimation.diagnosis.variables import variables_of, within
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


@dataclass(frozen=True)
class Contest:
    """An effect beside the others that were found, and its rivals in its place.

    Attributes:
        rivalry: The effect, and its rivals.
        others: The others.
    """

    rivalry: tuple[Tried, list[Tried]]
    others: list[Candidate]


def searched(search: Search) -> Discovery:
    """Search forwards, in pairs, and backwards; then ask what else each effect could be."""
    made = forwards(search)
    kept = backwards(search, made.found)
    stay = [made.found[j] for j in kept]
    contests: dict[int, Contest] = {}
    for k in range(len(stay)):
        contests[k] = _contest(search, stay, k)
        own, rivals = contests[k].rivalry
        shown = [r for r in rivals if r.shown]
        if (best := better(search, own, shown, contests[k].others)) is not None:
            stay[k] = best
            contests = {}  # what stood beside this effect was held against another one
    named = [
        _named(search, made.trials[j], contests.get(k) or _contest(search, stay, k))
        for k, j in enumerate(kept)
    ]
    named = withdrawn(named, search)
    stays = [n.candidate for n in named if n.veto is None]
    terms = [*search.balance.terms, *stays]
    left = best_map(search.balance, terms, search.gates.draws, search.seed)
    return Discovery(tuple(named), tuple(made.steps), tuple(made.ranking), left)


def withdrawn(named: Sequence[Named], search: Search) -> list[Named]:
    """Withdraw names too that a map leaves nothing to do, which withdrew those they stood beside.

    Of two effects that together imitate a third neither is there.
    """
    maps = [n.veto for n in named if n.veto is not None]
    if not maps:
        return list(named)
    stays = [n.candidate for n in named if n.veto is None]
    mapped = [
        np.hstack([run.centred(found.columns(run)) for found in maps])
        for run in search.balance.runs
    ]
    told = []
    for one in named:
        if one.veto is None:
            beside = Beside.of(search, [c for c in stays if c != one.candidate])
            base = [np.hstack(parts) for parts in zip(beside.base, mapped, strict=True)]
            losses = losses_of(base, search.balance.columns([one.candidate]), beside.left)
            alone, joint = losses.base[:, 0], losses.joint[:, 0, 0]
            worth = alone.sum() - joint.sum() >= search.floor
            if not worth or runs_agree(alone, joint) > search.gates.agree:
                one = replace(one, veto=maps[0])
        told.append(one)
    return told


def _contest(search: Search, found: Sequence[Candidate], k: int) -> Contest:
    others = [f for j, f in enumerate(found) if j != k]
    beside = Beside.of(search, others)
    own = tried(search, beside, found[k])
    rivals = rivals_of(search, beside, found[k], float(own.plain.gain[0, 0]))
    return Contest((own, rivals), others)


def _named(search: Search, trial: Trial, contest: Contest) -> Named:
    """Ask what else an effect could be, how sure its name is, and whether a map does better."""
    (own, offered), others = contest.rivalry, contest.others
    rivals = [r for r in offered if r.shown]
    mine = own.plain
    total, gain = mine.base[:, 0], float(mine.gain[0, 0])
    near = [
        r
        for r in (offered if search.hardly_told else rivals)
        if 1 - r.losses.sum() / total.sum() >= search.gates.rival * gain
        and runs_agree(total, r.losses) <= search.gates.agree
        and (search.hardly_told or not beaten(search, own, r))
    ]
    same = own.candidate.effect.same_as
    if any(r.candidate.family not in same and not r.depends_as(own) for r in near):
        near = with_alike(near, own, offered)
    near.sort(key=lambda r: float(r.losses.sum()))
    wins = _wins(own.losses, [r.losses for r in rivals], search.seed)
    terms = [*search.balance.terms, *others]
    flat = best_map(search.balance, terms, 0, search.seed)
    withdrawn = (
        flat is not None
        and not search.hardly_told
        and flat.variables != own.candidate.effect.any_function_of
        and _vetoes(search, flat, mine)
        and not _of_their_form(search, [own.candidate, *others], gain, flat)
    )
    return Named(
        own.candidate,
        trial,
        gain,
        tuple(r.candidate.family for r in near),
        wins * (1 - trial.p) * (1 - trial.agree),
        flat if withdrawn else None,
    )


def _of_their_form(search: Search, found: Sequence[Candidate], gain: float, flat: Map) -> bool:
    """Say whether a map only bends the formulas found: their variables, and little more gain."""
    known = {v for candidate in found for v in variables_of(candidate, search.balance)}
    share, left = gain / flat.gain, (1 - flat.gain) / (1 - gain)
    clear, fair = search.gates.form, search.gates.fair_form
    bends = share >= clear or (share >= fair and left >= search.gates.left_of_form)
    return within(flat.variables, known) and bends


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
