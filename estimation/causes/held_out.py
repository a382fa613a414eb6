"""The test runs: opened once, when every hypothesis is fixed, to keep or drop each cause."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimation.causes.candidates import Candidate, Claim, laid_out, with_skews
from estimation.causes.equations import Layout
from estimation.causes.joint import Joint, Part
from estimation.causes.numbers import Numbers
from estimation.causes.sources import Source
from estimation.derived import CAMPAIGN_TIME
from estimation.diagnosis.split import Sealed
from estimation.recording import FloatArray


@dataclass(frozen=True)
class Gains:
    """The score of one more cause in each test run.

    Attributes:
        by_run: Run to score, as if the cause acted in those that are open.
        is_open: Runs in which the training runs do not decide whether it acts.
    """

    by_run: Mapping[str, float]
    is_open: frozenset[str]

    def log_ratio(self, per_score: float) -> float:
        """Return the logarithm of the likelihood ratio of all runs.

        In a run that is open it is that of the mean of acting and not acting.

        Args:
            per_score: Log likelihood ratio for one unit of score in one run.
        """
        total = 0.0
        for name, gain in self.by_run.items():
            ratio = per_score * gain
            total += np.logaddexp(ratio, 0.0) - math.log(2.0) if name in self.is_open else ratio
        return float(total)


class HeldOut:
    """The evidence of the test runs for each cause.

    Args:
        layout: All runs.
        sealed: Which runs train and which test.
        numbers: What decides.
        late: Short delays of readings that are part of the base.
    """

    def __init__(
        self, layout: Layout, sealed: Sealed, numbers: Numbers, late: Sequence[Claim] = ()
    ) -> None:
        self.layout, self.numbers = layout, numbers
        self.joint = with_skews(Joint(layout, numbers), late)
        self._last: tuple[tuple[Candidate, ...], Joint, Mapping[Part, FloatArray]] | None = None
        self.at = [k for k, run in enumerate(layout.runs) if run.name in set(sealed.confirm)]

    def acts_in(
        self, before: Sequence[Candidate], cause: Candidate
    ) -> tuple[Mapping[str, bool], Sequence[str]]:
        """Return whether a cause acts in each run, and the test runs that themselves decide it.

        A test run between a run in which the cause acts and one in which it does not is open: a
        change at one time of the campaign may be before it or after it. The cause acts in it if it
        lowers the error there, next to the causes before it.
        """
        known = self._known(cause)
        is_open = [name for name, acts in known.items() if acts is None]
        found = self.gains(before, cause).by_run if is_open else {}
        acts = {name: found[name] > 0.0 if x is None else x for name, x in known.items()}
        return acts, is_open

    def _known(self, candidate: Candidate) -> Mapping[str, bool | None]:
        """Return whether a cause acts in each run; None where the training runs do not decide."""
        order = [run.name for run in self.layout.runs]
        train = [r for k, r in enumerate(order) if k not in self.at]
        since_s = _since(candidate)
        if candidate.acts is not None:
            known = dict(zip(train, candidate.acts, strict=True))
        elif since_s is not None:
            ends = {r.name: float(r.channels[CAMPAIGN_TIME][-1]) for r in self.layout.runs}
            known = {name: ends[name] >= since_s for name in train}
        else:
            return dict.fromkeys(order, True)
        out: dict[str, bool | None] = {}
        for k, name in enumerate(order):
            before = [known[n] for n in order[: k + 1] if n in known][-1:]
            after = [known[n] for n in order[k:] if n in known][:1]
            around = {*before, *after}
            out[name] = around.pop() if len(around) == 1 else None
        return out

    def gains(self, before: Sequence[Candidate], cause: Candidate) -> "Gains":
        """Return the score of one more cause in each test run, next to the causes before it."""
        joint, old = self._next_to(before)
        new = self._squared(self._with(joint, cause))
        total = np.zeros(len(self.at))
        for p, samples in self.joint.samples.items():
            mean = [e[p] / samples[self.at] for e in (old, new)]
            total += self.joint.log_ratio(p, mean[0], mean[1])
        names = [self.layout.runs[k].name for k in self.at]
        is_open = frozenset(name for name, acts in self._known(cause).items() if acts is None)
        return Gains(dict(zip(names, total.tolist(), strict=True)), is_open)

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
        (errors,) = joint.base_errors([[self.at]])
        return {p: values[self.at] for p, values in errors.items()}

    def _with(self, joint: Joint, candidate: Candidate) -> Joint:
        """Return a regression with a cause; where it is open whether it acts it does."""
        acts = None
        if candidate.acts is not None:
            acts = tuple(on is not False for on in self._known(candidate).values())
        laid = laid_out(self.joint, Claim(candidate.cause, acts))
        return joint if laid is None else joint.with_cause(laid.laid, laid.precision)


def _since(candidate: Candidate) -> float | None:
    """Return the time of the campaign from which a cause acts, s; None where it has none."""
    cause = candidate.cause
    if not isinstance(cause, Source) or "campaign_clock" not in cause.effect.roles:
        return None
    shape = {p.name: x for p, x in zip(cause.effect.shape, cause.shape, strict=True)}
    return shape.get("since")
