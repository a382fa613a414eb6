"""The test runs: opened once, when every hypothesis is fixed, to keep or drop each cause."""

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.causes.apart import Apart, apart
from estimation.causes.candidates import Candidate, Claim, laid_out
from estimation.causes.criterion import base_errors, log_ratio
from estimation.causes.joint import Joint
from estimation.causes.laid import TINY, Part
from estimation.causes.layout import Layout
from estimation.causes.nuisances import with_skews
from estimation.causes.numbers import Numbers
from estimation.causes.sources import Source
from estimation.derived import CAMPAIGN_TIME
from estimation.diagnosis.split import Sealed
from estimation.recording import FloatArray

OPEN = 0.05
"""Probability of acting, or of not acting, below which the training runs decide."""


@dataclass(frozen=True)
class Gains:
    """What one more cause shows in each test run, as a score and as evidence.

    Attributes:
        scores: Run to score, as if the cause acted there and as if it did not: then the other
            parameters are known better.
        logs: The same as a log likelihood ratio.
        acting: Run to the probability that it acts there, from the training runs.
    """

    scores: Mapping[str, tuple[float, float]]
    logs: Mapping[str, tuple[float, float]]
    acting: Mapping[str, float]

    def score(self, rate: float) -> float:
        """Return the score of all runs, at so much of the log odds for one unit of it."""
        scaled = {name: (rate * x, rate * y) for name, (x, y) in self.scores.items()}
        return self._sum(scaled) / rate

    def log_ratio(self) -> float:
        """Return the logarithm of the likelihood ratio of all runs."""
        return self._sum(self.logs)

    def acts_in(self, name: str) -> bool:
        """Whether the cause more probably acts in a run than not, the run itself included."""
        acting, not_acting = self._odds(name, self.logs)
        return acting > not_acting

    def _sum(self, logs: Mapping[str, tuple[float, float]]) -> float:
        """Return the sum over runs; in each the ratio is the mean of acting and not acting."""
        return float(sum(np.logaddexp(*self._odds(name, logs)) for name in logs))

    def _odds(self, name: str, logs: Mapping[str, tuple[float, float]]) -> tuple[float, float]:
        """Return the log likelihood of acting in a run, and that of not acting."""
        acting, (by_run, without) = self.acting[name], logs[name]
        return _log(acting) + by_run, _log(1.0 - acting) + without


class HeldOut:
    """The evidence of the test runs for each cause, next to short delays of late readings."""

    def __init__(
        self, layout: Layout, sealed: Sealed, numbers: Numbers, late: Sequence[Claim] = ()
    ) -> None:
        self.layout, self.numbers = layout, numbers
        self.joint = with_skews(Joint(layout, numbers), late)
        self._last: tuple[tuple[Candidate, ...], Joint, Mapping[Part, FloatArray]] | None = None
        self.at = [k for k, run in enumerate(layout.runs) if run.name in set(sealed.confirm)]

    def apart(self, kept: Sequence[tuple[Candidate, Collection[str]]]) -> list[Apart]:
        """Return the runs of which one channel is not what the others predict.

        Args:
            kept: The causes found, each with the runs in which it acts; they predict too.
        """
        joint = self.joint
        for candidate, runs in kept:
            some = tuple(run.name in runs for run in self.layout.runs)
            joint = self._grown(joint, candidate, None if candidate.acts is None else some)
        return apart(joint)

    def acts_in(
        self, before: Sequence[Candidate], cause: Candidate
    ) -> tuple[Mapping[str, bool], Sequence[str]]:
        """Return whether a cause acts in each run, and the test runs that themselves decide it."""
        acting = self._acting(cause)
        is_open = [name for name, p in acting.items() if min(p, 1.0 - p) > OPEN]
        acts = {name: p > 0.5 for name, p in acting.items()}
        if is_open:
            gains = self.gains(before, cause)
            acts |= {name: gains.acts_in(name) for name in is_open}
        return acts, is_open

    def begun(self, candidate: Candidate, acts_in: Mapping[str, bool]) -> Candidate:
        """Return a change at one time of the campaign with the time at which the runs show it.

        The training runs show it to lie between two of them; a test run there is before or after.
        """
        acting = [acts_in[run.name] for run in self.layout.runs]
        cause = candidate.cause
        if not isinstance(cause, Source) or _since(candidate) is None:
            return candidate
        if not any(acting) or acting != sorted(acting):  # it did not begin once, and stay
            return candidate
        first = self.layout.runs[acting.index(True)]
        begins_s = float(first.channels[CAMPAIGN_TIME][0])
        shape = [
            begins_s if p.name == "since" else x
            for p, x in zip(cause.effect.shape, cause.shape, strict=True)
        ]
        return replace(candidate, cause=replace(cause, shape=tuple(shape)))

    def _acting(self, candidate: Candidate) -> Mapping[str, float]:
        """Return the probability that a cause acts in each run, from the training runs.

        From one training run to the next, a cause comes or goes as often as it does on average
        over them: one that came once acts in a test run between two runs that have it, and one
        that comes and goes need not.
        """
        order = [run.name for run in self.layout.runs]
        train = [r for k, r in enumerate(order) if k not in self.at]
        since_s = _since(candidate)
        if candidate.acts is not None:
            known = dict(zip(train, candidate.acts, strict=True))
        elif since_s is not None:
            ends = {r.name: float(r.channels[CAMPAIGN_TIME][-1]) for r in self.layout.runs}
            known = {name: ends[name] >= since_s for name in train}
        else:
            return dict.fromkeys(order, 1.0)
        states = [*known.values()]
        changes = sum(a != b for a, b in itertools.pairwise(states))
        # a change at one time of the campaign does not come and go
        change = 0.0 if candidate.acts is None else min(0.5, changes / max(1, len(states) - 1))
        out: dict[str, float] = {}
        for k, name in enumerate(order):
            if name in known:
                out[name] = float(known[name])
                continue
            before = [known[n] for n in order[:k] if n in known][-1:]
            after = [known[n] for n in order[k:] if n in known][:1]
            acting, not_acting = (
                math.prod(1.0 - change if x == state else change for x in (*before, *after))
                for state in (True, False)
            )
            out[name] = acting / (acting + not_acting) if acting + not_acting else 0.5
        return out

    def gains(self, before: Sequence[Candidate], cause: Candidate) -> Gains:
        """Return the score and the evidence of one more cause, next to the causes before it."""
        joint, old = self._next_to(before)
        acting, names = self._acting(cause), [self.layout.runs[k].name for k in self.at]
        scores, logs = (np.zeros((2, len(self.at))) for _ in range(2))
        scores[0], logs[0] = self._shown(old, self._squared(self._with(joint, cause)))
        if any(acting[name] < 1.0 for name in names):
            without = self._squared(self._with(joint, cause, in_test=False))
            scores[1], logs[1] = self._shown(old, without)
        pairs = [
            {name: (float(x[0]), float(x[1])) for name, x in zip(names, own.T, strict=True)}
            for own in (scores, logs)
        ]
        return Gains(pairs[0], pairs[1], acting)

    def _shown(
        self, before: Mapping[Part, FloatArray], after: Mapping[Part, FloatArray]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the score of each test run and its log likelihood ratio, from squared errors."""
        score, log, numbers = np.zeros(len(self.at)), np.zeros(len(self.at)), self.numbers
        for p, samples in self.joint.samples.items():
            mean = [e[p] / samples[self.at] for e in (before, after)]
            own = log_ratio(self.joint, p, mean[0], mean[1])
            score += own
            if p[1] == "between":
                # the ratio of two single squares may be anything: each is held against all runs
                both = [float(x.mean()) for x in mean]
                ratio = log_ratio(self.joint, p, both[0], np.array(both[1]))
                part = mean[0] / (both[0] + TINY) - mean[1] / (both[1] + TINY)
                own = ratio + numbers.between * part
            log += 0.5 * numbers.samples_a_run * own
        return score, log

    def _next_to(self, causes: Sequence[Candidate]) -> tuple[Joint, Mapping[Part, FloatArray]]:
        """Return the regression with causes, and its squared errors; the last one is kept."""
        if self._last is None or [*map(id, self._last[0])] != [*map(id, causes)]:
            joint = self.joint
            for cause in causes:
                joint = self._with(joint, cause)
            self._last = tuple(causes), joint, self._squared(joint)
        return self._last[1:]

    def _squared(self, joint: Joint) -> Mapping[Part, FloatArray]:
        """Return the squared error of each test run, fitted on the training runs alone."""
        (errors,) = base_errors(joint, [[self.at]])
        return {p: values[self.at] for p, values in errors.items()}

    def _with(self, joint: Joint, candidate: Candidate, in_test: bool = True) -> Joint:
        """Return a regression with a cause, as if it acted in every test run, or in none."""
        acts = None
        if candidate.acts is not None or not in_test:
            count = len(self.layout.runs)
            trained = iter(candidate.acts or itertools.repeat(True, count))
            acts = tuple(in_test if k in self.at else next(trained) for k in range(count))
        return self._grown(joint, candidate, acts)

    def _grown(self, joint: Joint, candidate: Candidate, acts: tuple[bool, ...] | None) -> Joint:
        """Return a regression with a cause that acts in some runs; in all when None."""
        given = candidate.given or candidate.acts is None
        laid = laid_out(self.joint, Claim(candidate.cause, acts, given=given))
        return joint if laid is None else joint.with_cause(laid.laid, laid.precision)


def _log(x: float) -> float:
    return math.log(x) if x > 0.0 else -math.inf


def _since(candidate: Candidate) -> float | None:
    """Return the time of the campaign from which a cause acts, s; None where it has none."""
    cause = candidate.cause
    if not isinstance(cause, Source) or "campaign_clock" not in cause.effect.roles:
        return None
    shape = {p.name: x for p, x in zip(cause.effect.shape, cause.shape, strict=True)}
    return shape.get("since")
