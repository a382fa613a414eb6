"""What is missing in some runs only, where nothing is that all runs share.

A pulley that slips under one load, a wrist that was bent in half of the runs: fitted to all runs,
such an effect helps some and harms the others, and the runs do not agree on it. Fitted with one
size to the runs that have it, it explains both halves of each, and of runs that were not opened
before. Few runs stand behind its name, so every other family must be far behind it there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import UNKNOWN, Candidate, pool
from estimation.diagnosis.design import covered, targets
from estimation.diagnosis.frozen import Frozen, samples_of, squares
from estimation.diagnosis.gates import Gates
from estimation.diagnosis.result import Finding, Value
from estimation.diagnosis.search import Search
from estimation.diagnosis.story import Story
from estimation.diagnosis.variables import variables_of
from estimation.recording import FloatArray

FEWEST = 3
"""Runs among those that discover that must have it, beside one that confirms."""

IN_NO_MODEL = (
    "what only some runs have is in no model that is written, since the others would be worse with"
    " it; its error is told by its finding alone."
)

TRIED = 8
"""Families that are tried, the best over all runs, then the best in the runs that have it."""

FAR = 0.5
"""A name leaves at most this share of what any other family leaves in the runs that have it."""

ROUNDS = 6
"""Times that the runs which have it are chosen anew, each time with its size in these."""


@dataclass(frozen=True)
class Partial:
    """An effect in some runs of one balance.

    Attributes:
        story: The story of the balance.
        held: The balance laid out on the confirm runs.
        effect: The effect.
        weights: Amplitudes of the declared effects, then its own.
        discover: Runs that have it, of those that discover.
        confirm: Runs that have it, of those that confirm.
        fall: Share of the squared error on the runs that discover which it removes there.
        confidence: One less the chance that a family no better is better in each of these runs, or
            None where another one is not far behind it.
    """

    story: Story
    held: Balance
    effect: Candidate
    weights: FloatArray
    discover: frozenset[str]
    confirm: frozenset[str]
    fall: float
    confidence: float | None = None

    @property
    def runs(self) -> frozenset[str]:
        """All runs that have it."""
        return self.discover | self.confirm


def missing_in_some_runs(
    stories: Mapping[str, Story], gates: Gates, measured: Sequence[str]
) -> Finding | None:
    """Return what is missing in some runs only, under the balance that shows it most, or None.

    Args:
        stories: Balance to its story, the confirm runs opened.
        gates: What an effect must pass: `some` is what it removes of both halves of a run.
        measured: Channels that all runs have.
    """
    found = [p for s in stories.values() if (p := _best(s, gates, measured)) is not None]
    if not found:
        return None
    most = max(found, key=lambda partial: (partial.confidence is not None, partial.fall))
    others = (p for p in found if p is not most and 2 * len(p.runs & most.runs) > len(p.runs))
    also = tuple(p.story.balance.model.balance for p in others)
    return replace(_told(most, gates.sure), also_in=also)


def _best(story: Story, gates: Gates, measured: Sequence[str]) -> Partial | None:
    """Return the effect that removes most in the runs that have it, where the confirm runs agree.

    Asked only where the first step stood out of what chance and the twins show.
    """
    steps = story.discovery.steps
    if story.balance.one_path or not steps or not steps[0].stands_out(gates):
        return None
    held = _confirming(story)
    ranked = [trial.candidates[0] for trial in story.discovery.ranking[:TRIED]]
    first = _most(story, held, ranked, gates)
    if first is None:
        return None
    # over all runs the right family may have shown nothing: ask all of them in these runs
    effects = _ranked_in(story, first.discover, gates, measured)
    best = _most(story, held, effects[:TRIED], gates) or first
    if not best.confirm:
        return None
    rivals = [effect for effect in effects if effect.family != best.effect.family]
    return replace(best, confidence=_confidence(best, rivals))


def _most(
    story: Story, held: Balance, effects: Sequence[Candidate], gates: Gates
) -> Partial | None:
    """Return the effect that removes most in the runs that have it."""
    found = [p for effect in effects if (p := _partial(story, held, effect, gates)) is not None]
    return max(found, key=lambda partial: partial.fall, default=None)


def _ranked_in(
    story: Story, there: frozenset[str], gates: Gates, measured: Sequence[str]
) -> list[Candidate]:
    """Return the best of each family of the catalogue in some of the runs, best first."""
    balance = story.balance
    which = [k for k, run in enumerate(balance.runs) if run.name in there]
    runs, target = [balance.runs[k] for k in which], [balance.target[k] for k in which]
    part = replace(balance, runs=runs, target=target, tables_of={})
    offered = covered(pool(balance.model, measured), runs)
    return [trial.candidates[0] for trial in Search(part, offered, gates).ranked([], 0)]


def _confidence(best: Partial, rivals: Sequence[Candidate]) -> float | None:
    """Hold an effect against others in the runs that have it, each at its own size there."""
    own = _left(best, best.effect, best.weights)
    for rival in rivals:
        other = _left(best, rival, _fitted(best.story.balance, rival, best.discover))
        if own.sum() > FAR * other.sum() or np.any(own >= other):
            return None
    return 1.0 - 0.5 ** len(own)


def _left(partial: Partial, effect: Candidate, weights: FloatArray) -> FloatArray:
    """Return the squared error that an effect leaves of each run that has another one."""
    left = []
    for part in (partial.story.balance, partial.held):
        _, after = _errors(part, effect, weights)
        runs = zip(part.runs, after, strict=True)
        left += [float(e @ e) for run, e in runs if run.name in partial.runs]
    return np.array(left)


def _confirming(story: Story) -> Balance:
    """Return the balance laid out on the confirm runs."""
    model = story.balance.model
    target = targets(story.confirm, model)
    return replace(story.balance, runs=story.confirm, target=target, tables_of={})


def _partial(story: Story, held: Balance, effect: Candidate, gates: Gates) -> Partial | None:
    """Choose the runs that have an effect and its size in them by turns, until they are the same.

    None where too few of the runs that discover have it, or all.
    """
    balance = story.balance
    names = [run.name for run in balance.runs]
    there, weights = frozenset(names), np.empty(0)
    for _ in range(ROUNDS):
        weights = _fitted(balance, effect, there)
        helped = _helped(balance, effect, weights, gates.some)
        if helped == there or len(helped) < FEWEST:
            there = helped
            break
        there = helped
    if not FEWEST <= len(there) < len(names):
        return None
    before, after = _errors(balance, effect, weights)
    falls = [
        float(b @ b - a @ a)
        for b, a, name in zip(before, after, names, strict=True)
        if name in there
    ]
    share = sum(falls) / sum(float(b @ b) for b in before)
    confirm = _helped(held, effect, weights, gates.some)
    return Partial(story, held, effect, weights, there, confirm, share)


def _fitted(balance: Balance, effect: Candidate, there: frozenset[str]) -> FloatArray:
    """Return the amplitudes of the declared effects, and of one that only some runs have."""
    blocks = balance.columns([effect])
    placed = [
        block if run.name in there else np.zeros_like(block)
        for run, block in zip(balance.runs, blocks, strict=True)
    ]
    terms = [*balance.terms, effect]
    return replace(balance, tables_of={**balance.tables_of, effect: placed}).solve(terms)


def _helped(
    balance: Balance, effect: Candidate, weights: FloatArray, least: float
) -> frozenset[str]:
    """Return the runs of whose squared error an effect removes this share, in either half."""
    before, after = _errors(balance, effect, weights)
    return frozenset(
        run.name
        for run, b, a in zip(balance.runs, before, after, strict=True)
        if all(
            float(new @ new) <= (1 - least) * float(old @ old)
            for old, new in zip(np.array_split(b, 2), np.array_split(a, 2), strict=True)
        )
    )


def _errors(
    balance: Balance, effect: Candidate, weights: FloatArray
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return what is left of each run without an effect and with it, the mean removed."""
    declared, own = balance.columns(balance.terms), balance.columns([effect])
    count = declared[0].shape[1]
    before = [y - d @ weights[:count] for y, d in zip(balance.target, declared, strict=True)]
    after = [e - c @ weights[count:] for e, c in zip(before, own, strict=True)]
    return before, after


def _told(partial: Partial, sure: float) -> Finding:
    story, balance, effect = partial.story, partial.story.balance, partial.effect
    with_it = Frozen(balance, (*balance.terms, effect), (), partial.weights, 0.0)
    old, new = (squares(f, story.confirm, at_rest=True) for f in (story.before, with_it))
    has = np.array([run.name in partial.confirm for run in story.confirm])
    samples = samples_of(story.confirm).sum()
    finding = Finding(
        balance=balance.model.balance,
        family=UNKNOWN,
        verdict="something_missing",
        rmse_before=float(np.sqrt(old.sum() / samples)),
        rmse_after=float(np.sqrt(np.where(has, new, old).sum() / samples)),
        runs_improved=int(np.count_nonzero(has & (new < old))),
        runs_total=len(story.confirm),
        runs_affected=tuple(sorted(partial.runs)),
    )
    if partial.confidence is None:
        return finding
    return replace(
        finding,
        family=effect.family,
        verdict="identified" if partial.confidence >= sure else "one_of",
        depends_on=variables_of(effect, balance),
        confidence=partial.confidence,
        parameters=_parameters(partial),
    )


def _parameters(partial: Partial) -> dict[str, Value]:
    """Return the size of an effect in the runs that have it; too few for an interval."""
    effect, target = partial.effect, partial.story.balance.model.target
    own = partial.weights[len(partial.weights) - len(effect.effect.amplitudes) :]
    numbers = zip(effect.term.parameters, (*own, *effect.shape), strict=True)
    return {p.name: Value(float(v), effect.term.unit(p, target), None) for p, v in numbers}
