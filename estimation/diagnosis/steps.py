"""Steps: which effects are added to a balance one after another, in pairs, and kept at the end."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from estimation.diagnosis.candidate import Candidate, related
from estimation.diagnosis.evidence import (
    Losses,
    leave_one_run_out,
    losses_of,
    runs_agree,
    surrogates,
)
from estimation.diagnosis.search import Search, Trial
from estimation.recording import FloatArray

TOPS = 12
"""Effects, the best of the first step, of which pairs are made."""


@dataclass
class Steps:
    """What a search added, and on what evidence.

    Attributes:
        found: The effects, in the order found.
        trials: The step that found each.
        steps: The best trial of each step, with the one that failed last.
        ranking: First step's families, best first.
    """

    found: list[Candidate] = field(default_factory=list)
    trials: list[Trial] = field(default_factory=list)
    steps: list[Trial] = field(default_factory=list)
    ranking: list[Trial] = field(default_factory=list)


def forwards(search: Search, on_found: Callable[[Trial], None] = lambda _: None) -> Steps:
    """Add effects while the best one passes every gate; the balance's shapes move along.

    Args:
        search: The catalogue laid out; its balance is refined with each step.
        on_found: Told each step that passed.
    """
    made = Steps()
    while len(made.found) < search.gates.most:
        ranked = search.ranked(made.found, search.gates.draws)
        made.ranking = made.ranking or ranked
        trial = _best(search, ranked, made.found)
        if trial is not None and not made.found:
            trial = _pair(search, ranked, _least_of_pair(search, trial, ranked)) or trial
        if trial is None:
            break
        trial = search.against_twins(trial)
        made.steps.append(trial)
        if not trial.passes(search.gates):
            break
        on_found(trial)
        made.found += trial.candidates
        made.trials += [trial] * len(trial.candidates)
        made.found = _refined(search, made.found)
    return made


def _refined(search: Search, found: Sequence[Candidate]) -> list[Candidate]:
    """Refine all shapes together; an effect that would lose its name's meaning keeps its own."""
    terms = search.balance.refined([*search.balance.terms, *found])
    declared = len(search.balance.terms)
    search.balance = replace(search.balance, terms=terms[:declared])
    moved = zip(found, terms[declared:], strict=True)
    kept = search.gates.akin  # where no name is asked for, the best shape is right
    return [new if kept or search.shows(new) else old for old, new in moved]


def _best(search: Search, ranked: Sequence[Trial], found: Sequence[Candidate]) -> Trial | None:
    """Return the best trial that passes, if it comes near the best of all; else that one.

    What gains most may gain it in a few runs, where another, nearly as good, gains in all: a drift
    that stands for how a loop begins. Those that would pass and are made of a regressor's noise are
    left out.
    """
    best: Trial | None = None
    for trial in ranked:
        if best is not None and trial.gain < search.gates.near * best.gain:
            break
        if _hangs_on_noise(search, trial, found):
            continue
        if trial.passes(search.gates):
            return trial
        best = best or trial
    return best


def _hangs_on_noise(search: Search, trial: Trial, found: Sequence[Candidate]) -> bool:
    # else it is refused for less
    return trial.passes(search.gates) and search.is_of_noise(trial, found)


def _least_of_pair(search: Search, first: Trial, ranked: Sequence[Trial]) -> float:
    """Return the gain above which a pair is taken in place of the best first step.

    Where that step passes, what it and the best one after it remove: two effects that mask one
    another together lead the search to a third that has a little of both.
    """
    gates = search.gates
    if not first.passes(gates):
        return 1.2 * ranked[0].gain + gates.floor
    left = 1.0 - first.gain
    if second := next(search.admissible(first.candidates, 0), None):
        left *= float(second.losses.sum() / first.losses.sum())
    return 1.0 - min(gates.together * left, left - gates.floor)


def _pair(search: Search, ranked: Sequence[Trial], least: float) -> Trial | None:
    """Return the best pair of effects of at least this gain, if it passes every gate."""
    tops = [t.candidates[0] for t in ranked[:TOPS]]
    pairs = [p for p in itertools.combinations(tops, 2) if not related(*p)]
    if not pairs:
        return None
    balance, gates = search.balance, search.gates
    left, base = balance.left(balance.terms), balance.base(balance.terms)
    blocks = [balance.columns(pair) for pair in pairs]
    joined = [np.hstack(parts) for parts in zip(*blocks, strict=True)]
    sizes = [block[0].shape[1] for block in blocks]
    plain = leave_one_run_out(base, joined, sizes, [r[:, None] for r in left])
    if plain.gain.max() < least:
        return None
    drawn = surrogates(left, gates.draws, search.seed + 1)
    aims = [np.column_stack([r, s]) for r, s in zip(left, drawn, strict=True)]
    losses = leave_one_run_out(base, joined, sizes, aims)
    null: FloatArray = losses.gain[:, 1:].max(axis=0)
    for k in np.argsort(-losses.gain[:, 0])[:5]:
        trial = search.trial(pairs[k], losses, int(k), null)
        worth = trial.gain >= least
        if not (worth and trial.passes(gates) and search.signs_hold(balance.terms, pairs[k])):
            continue
        if not _hangs_on_noise(search, trial, ()):
            return trial
    return None


def backwards(search: Search, found: Sequence[Candidate]) -> list[int]:
    """Return the places of the effects that are still needed beside the others."""
    gates = search.gates
    kept = list(range(len(found)))
    while len(kept) > 1:
        gains, shares = {}, {}
        for k in kept:
            losses = _beside(search, [found[j] for j in kept if j != k], found[k])
            loss, joint = losses.base[:, 0], losses.joint[:, 0, 0]
            enough = runs_agree(loss, joint) <= gates.agree
            gains[k] = float(loss.sum() - joint.sum()) if enough else -1.0
            shares[k] = gains[k] / float(loss.sum())
        weakest = min(kept, key=lambda k: gains[k])
        small = gains[weakest] < gates.leftover * _explained(search, [found[k] for k in kept])
        if gains[weakest] >= search.floor and not (small and shares[weakest] < gates.most_left):
            break
        kept.remove(weakest)
    return kept


def _explained(search: Search, found: Sequence[Candidate]) -> float:
    """Return the squared error that effects remove together."""
    return search.declared_loss - search.balance.loss([*search.balance.terms, *found])


def _beside(search: Search, others: Sequence[Candidate], one: Candidate) -> Losses:
    """Return the losses of one found effect beside others."""
    balance = search.balance
    terms = [*balance.terms, *others]
    return losses_of(balance.base(terms), balance.columns([one]), balance.left(terms))
