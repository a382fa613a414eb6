"""The search: which effect of the catalogue removes the residual, and whether that is proved."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate, related
from estimation.diagnosis.design import spans_of, tables
from estimation.diagnosis.endogeneity import bends_force, kept_share, noise_share, own_share
from estimation.diagnosis.evidence import (
    Losses,
    chance,
    leave_one_run_out,
    runs_agree,
    surrogates,
)
from estimation.diagnosis.gates import Gates
from estimation.recording import FloatArray

TwinNull = Callable[[float, float], float]
"""Fall of squared error (target unit squared, pooled mean) and its share of the error it falls
from, to its p-value under the twin."""


@dataclass(frozen=True)
class Trial:
    """One family at its best point, in one step of the search.

    Attributes:
        candidates: The effect, or the two of a pair.
        gain: Share of squared error removed on runs left out.
        worth: The same as a share of what the declared model alone leaves.
        losses: Squared error of each run left out, shape (runs,).
        p: Chance of such a gain from anything in the catalogue on surrogates.
        p_twin: The same on simulated twins of the declared model, or None when there were none.
        agree: Signed-rank p-value over the runs.
    """

    candidates: tuple[Candidate, ...]
    gain: float
    worth: float
    losses: FloatArray
    p: float = 1.0
    p_twin: float | None = None
    agree: float = 1.0

    @property
    def family(self) -> str:
        """Family, or families, of the trial."""
        return " + ".join(c.family for c in self.candidates)

    def passes(self, gates: Gates) -> bool:
        """Say whether the trial passes every gate."""
        return self.stands_out(gates) and self.agree <= gates.agree

    def stands_out(self, gates: Gates) -> bool:
        """Say whether the gain is above chance and above the floor, in whatever runs."""
        likely = self.p <= gates.level and (self.p_twin or 0.0) <= gates.chance
        return likely and self.worth >= gates.floor


@dataclass
class Search:
    """The catalogue laid out on one balance.

    Attributes:
        balance: The balance.
        pool: Every candidate.
        gates: What must be passed.
        seed: Seed of surrogates and bootstraps.
        twin: P-value of a fall of error under the simulated twin, or None.
    """

    balance: Balance
    pool: list[Candidate]
    gates: Gates
    seed: int = 0
    twin: TwinNull | None = None
    table: list[FloatArray] = field(init=False)
    declared_loss: float = field(init=False)

    def __post_init__(self) -> None:
        balance = self.balance
        self.declared_loss = balance.loss(balance.terms)
        self.table = tables(balance.runs, self.pool, balance.demean, balance.mapper)

    @property
    def sizes(self) -> list[int]:
        """Columns of each candidate."""
        return [len(c.effect.amplitudes) for c in self.pool]

    def forwards(
        self, on_found: Callable[[Trial], None] = lambda _: None
    ) -> tuple[list[Candidate], list[Trial], list[Trial], list[Trial]]:
        """Add effects while the best one passes every gate; the balance's shapes move along.

        Args:
            on_found: Told each step that passed.

        Returns:
            The effects found, the step that found each, every step with the one that failed last,
            and the first step's ranking.
        """
        found: list[Candidate] = []
        trials: list[Trial] = []
        steps: list[Trial] = []
        ranking: list[Trial] = []
        while len(found) < self.gates.most:
            ranked = self.ranked(found, self.gates.draws)
            ranking = ranking or ranked
            trial = self._best(ranked, found)
            if trial is not None and not found:
                trial = self._pair(ranked, self._alone(trial, ranked)) or trial
            if trial is None:
                break
            trial = self._against_twins(trial)
            steps.append(trial)
            if not trial.passes(self.gates):
                break
            on_found(trial)
            found += trial.candidates
            trials += [trial] * len(trial.candidates)
            terms = self.balance.refined([*self.balance.terms, *found])
            self.balance = replace(self.balance, terms=terms[: -len(found)])
            moved = zip(found, terms[-len(found) :], strict=True)
            kept = self.gates.akin  # where no name is asked for, the best shape is right
            found = [new if kept or self.shows(new) else old for old, new in moved]
        return found, trials, steps, ranking

    def shows(self, candidate: Candidate) -> bool:
        """Say whether a refined effect still is what its name says."""
        spans = spans_of([candidate], self.balance.runs)
        return candidate.shows(spans) and not candidate.is_limit

    def _best(self, ranked: Sequence[Trial], found: Sequence[Candidate]) -> Trial | None:
        """Return the best trial that passes, if it comes near the best of all; else that one.

        What gains most may gain it in a few runs, where another, nearly as good, gains in all: a
        drift that stands for how a loop begins. Those that would pass and are made of a regressor's
        noise are left out.
        """
        best: Trial | None = None
        for trial in ranked:
            if best is not None and trial.gain < self.gates.near * best.gain:
                break
            if self._hangs_on_noise(trial, found):
                continue
            if trial.passes(self.gates):
                return trial
            best = best or trial
        return best

    def _hangs_on_noise(self, trial: Trial, found: Sequence[Candidate]) -> bool:
        # else it is refused for less
        return trial.passes(self.gates) and self._is_of_noise(trial, found)

    def _is_of_noise(self, trial: Trial, found: Sequence[Candidate]) -> bool:
        terms = [*self.balance.terms, *found]
        if not bends_force(terms, trial.candidates):
            noise = noise_share(self.balance, terms, self.balance.columns(trial.candidates))
            if noise > self.gates.noise:
                return True
        share = kept_share(self.balance, terms, trial.candidates)
        return share is not None and share < self.gates.kept

    @cached_property
    def hardly_told(self) -> bool:
        """Whether the runs hardly tell the declared gain on a force from what stands beside it."""
        return own_share(self.balance) < self.gates.told

    @property
    def floor(self) -> float:
        """Least fall of squared error, of what the declared model alone leaves."""
        return self.gates.floor * self.declared_loss

    def ranked(self, found: Sequence[Candidate], count: int) -> list[Trial]:
        """Return each admissible family's best trial beside what is found, best first."""
        return list(self._admissible(found, count))

    def largest(self) -> Trial | None:
        """Return what the search would take first, without asking whether it is chance."""
        return next((t for t in self._admissible([], 0) if not self._is_of_noise(t, [])), None)

    def _admissible(self, found: Sequence[Candidate], count: int) -> Iterator[Trial]:
        losses, null = self._scored([*self.balance.terms, *found], count)
        gains = losses.gain[:, 0]
        seen: set[str] = set()
        refused: dict[str, int] = {}
        for k in np.argsort(-gains):
            candidate = self.pool[k]
            family = candidate.family
            if family in seen or refused.get(family, 0) > 3 or gains[k] <= 0:
                continue
            if candidate.is_limit:
                continue
            if not self.gates.akin and any(related(candidate, f) for f in found):
                continue
            if self._too_large([*found, candidate]):
                continue
            if not self._signs_hold([*self.balance.terms, *found], [candidate]):
                refused[family] = refused.get(family, 0) + 1
                continue
            seen.add(family)
            yield self._trial((candidate,), losses, int(k), null)

    def _too_large(self, found: Sequence[Candidate]) -> bool:
        """Say whether the model with these effects has more parameters than allowed."""
        count = sum(len(t.parameters) for t in self.balance.model.terms)
        count += sum(len(c.term.parameters) for c in found)
        return self.gates.parameters is not None and count > self.gates.parameters

    def _scored(self, terms: Sequence[Candidate], count: int) -> tuple[Losses, FloatArray]:
        """Return losses of the whole pool, and the largest gain on each surrogate."""
        left = self.balance.left(terms)
        drawn = surrogates(left, count, self.seed)
        aims = [np.column_stack([r, s]) for r, s in zip(left, drawn, strict=True)]
        losses = leave_one_run_out(self.balance.base(terms), self.table, self.sizes, aims)
        null: FloatArray = losses.gain[:, 1:].max(axis=0) if self.pool else np.zeros(count)
        return losses, null

    def _trial(
        self, which: tuple[Candidate, ...], losses: Losses, k: int, null: FloatArray
    ) -> Trial:
        gain = float(losses.gain[k, 0])
        joint, base = losses.joint[:, k, 0], losses.base[:, 0]
        fall = float(base.sum() - joint.sum())
        return Trial(
            which,
            gain,
            fall / self.declared_loss,
            joint,
            chance(gain, null),
            agree=runs_agree(base, joint),
        )

    def _against_twins(self, trial: Trial) -> Trial:
        """Hold a trial that stands out from the surrogates against the simulated twins too."""
        if self.twin is None or not trial.stands_out(self.gates):
            return trial
        samples = sum(len(y) for y in self.balance.target)
        return replace(
            trial, p_twin=self.twin(trial.worth * self.declared_loss / samples, trial.gain)
        )

    def _signs_hold(self, terms: Sequence[Candidate], added: Sequence[Candidate]) -> bool:
        """Say whether amplitudes within their bounds do nearly as well as any amplitudes.

        What may have either sign must do half as well as with any amplitudes of the declared
        effects: no negative friction may have to stand beside it.
        """
        own = [p for c in added for p in c.effect.amplitudes]
        together = [*terms, *added]
        before, after = self.balance.loss(terms), self.balance.loss(together)
        free = self._free_loss(together)
        if all(p.lower < 0 < p.upper for p in own):
            weights = self.balance.solve(together)[-len(own) :]
            inside = all(
                0.999 * p.lower < w < 0.999 * p.upper for p, w in zip(own, weights, strict=True)
            )
            return inside and before - after >= 0.5 * (self._free_loss(terms) - free)
        return before - after >= 0.8 * max(before - free, 0.0) and after < before

    def _free_loss(self, terms: Sequence[Candidate]) -> float:
        """Return the squared error with amplitudes of any sign and size."""
        columns = np.vstack(self.balance.columns(terms))
        aim = np.concatenate(self.balance.target)
        left = aim - columns @ np.linalg.lstsq(columns, aim, rcond=1e-10)[0]
        return float(left @ left)

    def _alone(self, first: Trial, ranked: Sequence[Trial]) -> float:
        """Return the gain above which a pair is taken in place of the best first step.

        Where that step passes, what it and the best one after it remove: two effects that mask one
        another together lead the search to a third that has a little of both.
        """
        if not first.passes(self.gates):
            return 1.2 * ranked[0].gain + self.gates.floor
        left = 1.0 - first.gain
        if second := next(self._admissible(first.candidates, 0), None):
            left *= float(second.losses.sum() / first.losses.sum())
        return 1.0 - min(self.gates.together * left, left - self.gates.floor)

    def _pair(self, ranked: Sequence[Trial], least: float) -> Trial | None:
        """Return the best pair of effects of at least this gain, if it passes every gate."""
        tops = [t.candidates[0] for t in ranked[:12]]
        pairs = [p for p in itertools.combinations(tops, 2) if not related(*p)]
        if not pairs:
            return None
        terms = self.balance.terms
        left = self.balance.left(terms)
        base = self.balance.base(terms)
        blocks = [self.balance.columns(pair) for pair in pairs]
        joined = [np.hstack(parts) for parts in zip(*blocks, strict=True)]
        sizes = [block[0].shape[1] for block in blocks]
        plain = leave_one_run_out(base, joined, sizes, [r[:, None] for r in left])
        if plain.gain.max() < least:
            return None
        drawn = surrogates(left, self.gates.draws, self.seed + 1)
        aims = [np.column_stack([r, s]) for r, s in zip(left, drawn, strict=True)]
        losses = leave_one_run_out(base, joined, sizes, aims)
        null: FloatArray = losses.gain[:, 1:].max(axis=0)
        for k in np.argsort(-losses.gain[:, 0])[:5]:
            trial = self._trial(pairs[k], losses, int(k), null)
            worth = trial.gain >= least
            if not (worth and trial.passes(self.gates) and self._signs_hold(terms, pairs[k])):
                continue
            if not self._hangs_on_noise(trial, ()):
                return trial
        return None

    def backwards(self, found: Sequence[Candidate]) -> list[int]:
        """Return the places of the effects that are still needed beside the others."""
        kept = list(range(len(found)))
        while len(kept) > 1:
            gains, shares = {}, {}
            for k in kept:
                losses = self.beside(found, kept, k)
                loss, joint = losses.base[:, 0], losses.joint[:, 0, 0]
                enough = runs_agree(loss, joint) <= self.gates.agree
                gains[k] = float(loss.sum() - joint.sum()) if enough else -1.0
                shares[k] = gains[k] / float(loss.sum())
            weakest = min(kept, key=lambda k: gains[k])
            small = gains[weakest] < self.gates.leftover * self._explained(found, kept)
            if gains[weakest] >= self.floor and not (
                small and shares[weakest] < self.gates.most_left
            ):
                break
            kept.remove(weakest)
        return kept

    def _explained(self, found: Sequence[Candidate], kept: Sequence[int]) -> float:
        """Return the squared error that effects remove together."""
        terms = [*self.balance.terms, *(found[k] for k in kept)]
        return self.declared_loss - self.balance.loss(terms)

    def beside(self, found: Sequence[Candidate], kept: Sequence[int], k: int) -> Losses:
        """Return the losses of one found effect beside all others."""
        others = [*self.balance.terms, *(found[j] for j in kept if j != k)]
        block = self.balance.columns([found[k]])
        aims = [r[:, None] for r in self.balance.left(others)]
        return leave_one_run_out(self.balance.base(others), block, [block[0].shape[1]], aims)
