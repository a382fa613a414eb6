"""The catalogue laid out on one balance: what each effect removes of it, and on what evidence."""

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
from estimation.diagnosis.wander import steadiness
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

    def shows(self, candidate: Candidate) -> bool:
        """Say whether a refined effect still is what its name says."""
        spans = spans_of([candidate], self.balance.runs)
        return candidate.shows(spans) and not candidate.is_limit

    def wanders(self, added: Sequence[Candidate], found: Sequence[Candidate]) -> bool:
        """Say whether effects of time alone go another way in each run beside what is found."""
        steady = steadiness(self.balance, [*self.balance.terms, *found], added)
        return steady is not None and steady < self.gates.steady

    def is_of_noise(self, trial: Trial, found: Sequence[Candidate]) -> bool:
        """Say whether what a trial removes may be the noise of what the sensors read."""
        terms = [*self.balance.terms, *found]
        if self.wanders(trial.candidates, found):
            return True
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
        return list(self.admissible(found, count))

    def largest(self) -> Trial | None:
        """Return what the search would take first, without asking whether it is chance."""
        return next((t for t in self.admissible([], 0) if not self.is_of_noise(t, [])), None)

    def admissible(self, found: Sequence[Candidate], count: int) -> Iterator[Trial]:
        """Yield each family's best trial whose signs hold beside what is found, best first.

        Args:
            found: Effects found already.
            count: Number of surrogates.
        """
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
            if not self.signs_hold([*self.balance.terms, *found], [candidate]):
                refused[family] = refused.get(family, 0) + 1
                continue
            seen.add(family)
            yield self.trial((candidate,), losses, int(k), null)

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

    def trial(
        self, which: tuple[Candidate, ...], losses: Losses, k: int, null: FloatArray
    ) -> Trial:
        """Return the trial of the block at place `k`, held against the largest gains by chance."""
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

    def against_twins(self, trial: Trial) -> Trial:
        """Hold a trial that stands out from the surrogates against the simulated twins too."""
        if self.twin is None or not trial.stands_out(self.gates):
            return trial
        samples = sum(len(y) for y in self.balance.target)
        return replace(
            trial, p_twin=self.twin(trial.worth * self.declared_loss / samples, trial.gain)
        )

    def signs_hold(self, terms: Sequence[Candidate], added: Sequence[Candidate]) -> bool:
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
