"""The search: which effect of the catalogue removes the residual, and whether that is proved."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate, related
from estimation.diagnosis.design import tables
from estimation.diagnosis.endogeneity import kept_share
from estimation.diagnosis.evidence import (
    Losses,
    chance,
    leave_one_run_out,
    resampled,
    runs_agree,
    surrogates,
)
from estimation.diagnosis.maps import Map, best_map
from estimation.recording import FloatArray

TwinNull = Callable[[float, float], float]
"""Fall of squared error (target unit squared, pooled mean) and its share of the error it falls
from, to its p-value under the twin."""


@dataclass(frozen=True, slots=True)
class Gates:
    """What an effect must pass on the runs that discover.

    Attributes:
        chance: Largest p-value of the max statistic over the whole catalogue.
        floor: Least share of squared error removed on runs left out.
        agree: Largest p-value of the signed-rank test over the runs.
        most: Effects added to a balance at most.
        surrogates: Number of surrogates.
        rival: A rival has at least this share of the winner's gain.
        veto: A map withdraws a name when it leaves at most this share of the name's error.
        map_floor: The floor of a map: with its many columns it bends to
            the noise of a sensor that the balance reads (a share of 0.04 to 0.12 on the simulated
            rig with nothing missing, three seeds, no twins).
        kept: Least share of what an effect adds that is left when it is fitted through instruments:
            less, and it is made of the noise of a regressor.
        leftover: Least share that an effect has in what all found in a balance remove together:
            what a name's form leaves of its own cause is no second cause.
        parameters: Named parameters of the whole model at most, or None for no limit.
        akin: Whether an effect may be added beside one that looks alike: where a model must
            predict well rather than be named surely.
        sure: Least confidence of `identified`.
        balances: Balances that are searched: each is given its share of the chance.
    """

    chance: float = 0.02
    floor: float = 0.02
    agree: float = 0.05
    most: int = 4
    surrogates: int = 199
    rival: float = 0.5
    veto: float = 0.9
    sure: float = 0.9
    map_floor: float = 0.2
    kept: float = 0.5
    leftover: float = 0.15
    parameters: int | None = None
    akin: bool = False
    balances: int = 1

    @property
    def level(self) -> float:
        """Largest p-value on surrogates in one balance of several (Bonferroni)."""
        return self.chance / self.balances

    @property
    def draws(self) -> int:
        """Number of surrogates: as asked, and enough to reach the level."""
        return max(self.surrogates, math.ceil(1.0 / self.level) - 1)


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

    def run(self) -> Discovery:
        """Search forwards, in pairs, and backwards; then ask what else each effect could be."""
        found, trials, steps, ranking = self.forwards()
        kept = self._backwards(found)
        named = [self._named([found[j] for j in kept], k, trials[j]) for k, j in enumerate(kept)]
        stays = [n.candidate for n in named if n.veto is None]
        terms = [*self.balance.terms, *stays]
        left = best_map(self.balance, terms, self.gates.draws, self.seed)
        return Discovery(tuple(named), tuple(steps), tuple(ranking), left)

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
            if trial is not None and not found and not trial.passes(self.gates):
                trial = self._pair(ranked) or trial
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
            found = terms[-len(found) :]
        return found, trials, steps, ranking

    def _best(self, ranked: Sequence[Trial], found: Sequence[Candidate]) -> Trial | None:
        """Return the best trial, but those that would pass and are made of a regressor's noise."""
        return next((t for t in ranked if not self._hangs_on_noise(t, found)), None)

    def _hangs_on_noise(self, trial: Trial, found: Sequence[Candidate]) -> bool:
        if not trial.passes(self.gates):
            return False  # it is refused for less
        share = kept_share(self.balance, [*self.balance.terms, *found], trial.candidates)
        return share is not None and share < self.gates.kept

    @property
    def floor(self) -> float:
        """Least fall of squared error, of what the declared model alone leaves."""
        return self.gates.floor * self.declared_loss

    def ranked(self, found: Sequence[Candidate], count: int) -> list[Trial]:
        """Return each admissible family's best trial beside what is found, best first."""
        losses, null = self._scored([*self.balance.terms, *found], count)
        gains = losses.gain[:, 0]
        order = np.argsort(-gains)
        trials: dict[str, Trial] = {}
        refused: dict[str, int] = {}
        for k in order:
            candidate = self.pool[k]
            family = candidate.family
            if family in trials or refused.get(family, 0) > 3 or gains[k] <= 0:
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
            trials[family] = self._trial((candidate,), losses, k, null)
        return list(trials.values())

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
        """Say whether amplitudes within their bounds do nearly as well as any amplitudes."""
        own = [p for c in added for p in c.effect.amplitudes]
        if all(p.lower < 0 < p.upper for p in own):
            weights = self.balance.solve([*terms, *added])[-len(own) :]
            return all(
                0.999 * p.lower < w < 0.999 * p.upper for p, w in zip(own, weights, strict=True)
            )
        together = [*terms, *added]
        before, after = self.balance.loss(terms), self.balance.loss(together)
        columns = np.vstack(self.balance.columns(together))
        aim = np.concatenate(self.balance.target)
        free = aim - columns @ np.linalg.lstsq(columns, aim, rcond=1e-10)[0]
        return before - after >= 0.8 * max(before - float(free @ free), 0.0) and after < before

    def _pair(self, ranked: Sequence[Trial]) -> Trial | None:
        """Return the best pair of effects that mask one another, if it passes every gate."""
        tops = [t.candidates[0] for t in ranked[:12]]
        pairs = [p for p in itertools.combinations(tops, 2) if not related(*p)]
        if not pairs:
            return None
        terms = self.balance.terms
        left = self.balance.left(terms)
        drawn = surrogates(left, self.gates.draws, self.seed + 1)
        aims = [np.column_stack([r, s]) for r, s in zip(left, drawn, strict=True)]
        blocks = [self.balance.columns(pair) for pair in pairs]
        joined = [np.hstack(parts) for parts in zip(*blocks, strict=True)]
        sizes = [block[0].shape[1] for block in blocks]
        losses = leave_one_run_out(self.balance.base(terms), joined, sizes, aims)
        null: FloatArray = losses.gain[:, 1:].max(axis=0)
        for k in np.argsort(-losses.gain[:, 0])[:5]:
            trial = self._trial(pairs[k], losses, int(k), null)
            worth = trial.gain >= 1.2 * ranked[0].gain + self.gates.floor
            if not (worth and trial.passes(self.gates) and self._signs_hold(terms, pairs[k])):
                continue
            if not self._hangs_on_noise(trial, ()):
                return trial
        return None

    def _backwards(self, found: Sequence[Candidate]) -> list[int]:
        """Return the places of the effects that are still needed beside the others."""
        kept = list(range(len(found)))
        while len(kept) > 1:
            gains = {}
            for k in kept:
                losses = self._beside(found, kept, k)
                loss, joint = losses.base[:, 0], losses.joint[:, 0, 0]
                enough = runs_agree(loss, joint) <= self.gates.agree
                gains[k] = float(loss.sum() - joint.sum()) if enough else -1.0
            weakest = min(kept, key=lambda k: gains[k])
            least = max(self.floor, self.gates.leftover * self._explained(found, kept))
            if gains[weakest] >= least:
                break
            kept.remove(weakest)
        return kept

    def _explained(self, found: Sequence[Candidate], kept: Sequence[int]) -> float:
        """Return the squared error that effects remove together."""
        terms = [*self.balance.terms, *(found[k] for k in kept)]
        return self.declared_loss - self.balance.loss(terms)

    def _beside(self, found: Sequence[Candidate], kept: Sequence[int], k: int) -> Losses:
        """Return the losses of one found effect beside all others."""
        others = [*self.balance.terms, *(found[j] for j in kept if j != k)]
        block = self.balance.columns([found[k]])
        aims = [r[:, None] for r in self.balance.left(others)]
        return leave_one_run_out(self.balance.base(others), block, [block[0].shape[1]], aims)

    def _named(self, found: Sequence[Candidate], k: int, trial: Trial) -> Named:
        """Ask what else an effect could be, how sure its name is, and whether a map does better."""
        others = [f for j, f in enumerate(found) if j != k]
        mine = self._beside(found, range(len(found)), k)
        own, gain = mine.joint[:, 0, 0], float(mine.gain[0, 0])
        rivals: dict[str, FloatArray] = {}
        for rival in self.ranked(others, 0):
            if rival.family == found[k].family or len(rivals) == 8:
                continue
            if rival.gain >= 0.8 * self.gates.rival * gain:
                best = self._polished(others, rival.candidates[0])
                if not best.is_limit:
                    rivals[rival.family] = self._losses_beside(others, best)
        total = mine.base[:, 0]
        near = {
            family: losses
            for family, losses in rivals.items()
            if 1 - losses.sum() / total.sum() >= self.gates.rival * gain
            and runs_agree(losses, own) > self.gates.agree
        }
        terms = [*self.balance.terms, *others]
        flat = best_map(self.balance, terms, 0, self.seed)
        better = (
            flat is not None
            and flat.variables != found[k].effect.any_function_of
            and self._vetoes(flat, mine)
        )
        return Named(
            found[k],
            trial,
            gain,
            tuple(sorted(near, key=lambda f: float(near[f].sum()))),
            _wins(own, list(rivals.values()), self.seed) * (1 - trial.p) * (1 - trial.agree),
            flat if better else None,
        )

    def _polished(self, others: Sequence[Candidate], rival: Candidate) -> Candidate:
        """Return a rival at its own best shape."""
        if not rival.shape:
            return rival
        return self.balance.refined([*self.balance.terms, *others, rival], passes=1)[-1]

    def _losses_beside(self, others: Sequence[Candidate], rival: Candidate) -> FloatArray:
        """Return the losses of each run left out with a rival in the winner's place."""
        terms = [*self.balance.terms, *others]
        block = self.balance.columns([rival])
        aims = [r[:, None] for r in self.balance.left(terms)]
        base = self.balance.base(terms)
        joint = leave_one_run_out(base, block, [block[0].shape[1]], aims).joint
        losses: FloatArray = joint[:, 0, 0]
        return losses

    def _vetoes(self, flat: Map, mine: Losses) -> bool:
        """Say whether a map predicts runs left out clearly better than the named effect."""
        # a map sees every second sample, so shares of its own base are compared
        share = mine.joint[:, 0, 0] / mine.base[:, 0]
        other = flat.losses / flat.base_losses
        pooled = flat.losses.sum() / flat.base_losses.sum()
        named = mine.joint[:, 0, 0].sum() / mine.base[:, 0].sum()
        clearly = pooled < self.gates.veto * named
        worth = (named - pooled) * mine.base[:, 0].sum() >= self.floor
        return bool(clearly and worth and runs_agree(share, other) <= self.gates.agree)


def _wins(own: FloatArray, rivals: Sequence[FloatArray], seed: int, count: int = 500) -> float:
    """Return the share of run bootstraps in which the winner leaves the least error."""
    if not rivals:
        return 1.0
    weights = resampled(len(own), count, seed)
    best = np.min([weights @ losses for losses in rivals], axis=0)
    return float(np.mean(weights @ own < best))
