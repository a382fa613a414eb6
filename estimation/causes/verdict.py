"""From the search's hypotheses to a diagnosis: names with probabilities, and errors on test runs.

The test runs take no part in the search. They are opened once, when every hypothesis is fixed.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimation.causes.equations import Layout, lay_out
from estimation.causes.functions import Function, names
from estimation.causes.instruments import add_instruments
from estimation.causes.joint import Joint, Part
from estimation.causes.numbers import DEFAULT, Numbers
from estimation.causes.search import Candidate, Found, Scored, laid_out, search
from estimation.diagnosis.result import Diagnosis, Error, Finding, Value
from estimation.diagnosis.split import Sealed
from estimation.model import Model
from estimation.recording import FloatArray, Recording

SURE = 0.9
"""Probability from which a single name is given; below it the verdict is a set."""

IN_SET = 0.95
"""Probability that a set covers."""

VARIABLE_OF_ROLE: Mapping[str, str] = {
    "speed": "velocity",
    "acceleration": "acceleration",
    "position": "spindle_angle",
    "output_angle": "spindle_angle",
    "encoder": "spindle_angle",
    "stop": "jaw_angle",
    "tilt": "jaw_angle",
    "motor_angle": "motor_angle",
    "load": "load",
    "reading": "load",
    "creeping": "load",
    "current": "current",
    "drive": "current",
    "clock": "time",
    "elapsed": "time",
    "campaign_clock": "time",
    "travel": "history",
    "temperature": "temperature",
}
"""Role of an effect to the variable a finding names."""


@dataclass(frozen=True)
class Probability:
    """A family's share of the posterior in one slot of the leading hypothesis.

    Attributes:
        family: The family.
        share: Its probability.
        best: Its best candidate.
    """

    family: str
    share: float
    best: Scored


def diagnose(
    recordings: Sequence[Recording],
    models: Sequence[Model],
    sealed: Sealed,
    numbers: Numbers = DEFAULT,
) -> Diagnosis:
    """Identify what the declared equations lack.

    Args:
        recordings: All runs.
        models: Declared equations.
        sealed: Which runs train and which test.
        numbers: What decides.

    Raises:
        LayoutError: No equation can be laid out on these runs.
        FitError: A declared equation cannot be identified.
    """
    began = time.perf_counter()
    layout = lay_out(models, recordings, sealed.discover)
    add_instruments(layout, sealed.discover)
    found = search(layout.select(sealed.discover), numbers)
    whole = _Test(layout, sealed, numbers)
    findings = _findings(found, whole, sealed, numbers)
    return Diagnosis(
        findings=tuple(findings),
        errors=whole.errors([f.scored.candidate for f in whole.kept]),
        unit={name: e.model.unit for name, e in layout.equations.items()},
        noise_floor=dict.fromkeys(layout.equations),
        moved={},
        sealed=sealed,
        undecided={
            m.balance: "its channels were not recorded"
            for m in models
            if m.balance not in layout.equations
        },
        notes=tuple(whole.notes),
        seconds=time.perf_counter() - began,
    )


def family_probabilities(ranked: Sequence[Scored], numbers: Numbers) -> list[Probability]:
    """Return the posterior over families of one slot, the likeliest first."""
    scores = np.array([s.score for s in ranked])
    weights = np.exp(numbers.sharpness * (scores - scores.max()))
    weights /= weights.sum()
    shares: dict[str, float] = {}
    best: dict[str, Scored] = {}
    for scored, weight in zip(ranked, weights, strict=True):
        family = scored.candidate.cause.family
        shares[family] = shares.get(family, 0.0) + float(weight)
        best.setdefault(family, scored)
    return sorted(
        (Probability(f, share, best[f]) for f, share in shares.items()), key=lambda p: -p.share
    )


@dataclass(frozen=True)
class _Kept:
    scored: Scored
    likely: Sequence[Probability]


class _Test:
    """The test runs, opened once: errors there before and after each cause."""

    def __init__(self, layout: Layout, sealed: Sealed, numbers: Numbers) -> None:
        self.layout, self.numbers = layout, numbers
        self.joint = Joint(layout, numbers)
        self.at = [k for k, run in enumerate(layout.runs) if run.name in set(sealed.confirm)]
        self.kept: list[_Kept] = []
        self.notes: list[str] = []

    def beside(self, joint: Joint, candidate: Candidate) -> Joint:
        """Return a regression with a cause; one of open runs acts in none of those."""
        acts = None
        if candidate.acts is not None:
            acts = tuple(on is True for on in self._state(candidate).values())
        laid = laid_out(self.layout, self.joint, candidate.cause, acts)
        return joint if laid is None else joint.with_cause(laid.laid, laid.precision)

    def _state(self, candidate: Candidate) -> Mapping[str, bool | None]:
        """Return whether a cause acts in each run; None where the training runs do not decide.

        A test run between a run in which the cause acts and one in which it does not is open.
        """
        order = [run.name for run in self.layout.runs]
        if candidate.acts is None:
            return dict.fromkeys(order, True)
        train = [r for k, r in enumerate(order) if k not in self.at]
        known = dict(zip(train, candidate.acts, strict=True))
        out: dict[str, bool | None] = {}
        for k, name in enumerate(order):
            before = [known[n] for n in order[: k + 1] if n in known][-1:]
            after = [known[n] for n in order[k:] if n in known][:1]
            around = {*before, *after}
            out[name] = around.pop() if len(around) == 1 else None
        return out

    def runs_affected(self, candidate: Candidate) -> tuple[str, ...]:
        """Return the runs in which a cause acts."""
        return tuple(name for name, acts in self._state(candidate).items() if acts)

    def squared(self, causes: Sequence[Candidate]) -> Mapping[Part, FloatArray]:
        """Return the squared error of each test run, fitted on the training runs alone."""
        joint = self.joint
        for cause in causes:
            joint = self.beside(joint, cause)
        (errors,) = joint.base_errors([[self.at]])
        return {p: values[self.at] for p, values in errors.items()}

    def gain(self, before: Sequence[Candidate], cause: Candidate) -> float:
        """Return the score of one more cause on the test runs."""
        old, new = self.squared(before), self.squared([*before, cause])
        state = self._state(cause)
        told = [k for k, at in enumerate(self.at) if state[self.layout.runs[at].name] is not None]
        if not told:
            return 0.0
        total = 0.0
        for p, samples in self.joint.samples.items():
            pair = [e[p][told].sum() / samples[self.at][told].sum() for e in (old, new)]
            total += float(self.joint.log_ratio(p, *pair))
        return total

    def rmse(self, causes: Sequence[Candidate], equation: str) -> float:
        """Return the root mean square error within test runs of one equation."""
        part = (equation, "within")
        samples = self.joint.samples[part][self.at].sum()
        return float(np.sqrt(self.squared(causes)[part].sum() / samples))

    def errors(self, causes: Sequence[Candidate]) -> dict[str, Error]:
        """Return the errors of every equation before and after the causes."""
        before, after = self.squared([]), self.squared(causes)
        out = {}
        for name in self.layout.equations:
            within, between = (name, "within"), (name, "between")
            samples = self.joint.samples[within][self.at]
            pairs = []
            for squares in (before, after):
                inner = squares[within].sum() / samples.sum()
                outer = inner + squares[between].mean()
                pairs.append((float(np.sqrt(inner)), float(np.sqrt(outer))))
            runs = [self.layout.runs[k].name for k in self.at]
            by_run = [
                dict(zip(runs, np.sqrt(s[within] / samples).tolist(), strict=True))
                for s in (before, after)
            ]
            out[name] = Error(
                pairs[0][0],
                pairs[1][0],
                pairs[0][1],
                pairs[1][1],
                (float("nan"), float("nan")),
                by_run[0],
                by_run[1],
            )
        return out


def _findings(found: Found, test: _Test, sealed: Sealed, numbers: Numbers) -> list[Finding]:
    findings: list[Finding] = []
    before: list[Candidate] = []
    for scored, ranked in zip(found.causes, found.conditional, strict=True):
        gain = test.gain(before, scored.candidate)
        evidence = float(np.exp(min(numbers.sharpness * gain, 300.0)))
        likely = family_probabilities(ranked, numbers)
        if evidence < numbers.kept_evidence:
            cause = scored.candidate.cause
            test.notes.append(
                f"{cause.family} ({cause.place.name}) was found in the training runs and not"
                " confirmed on the test runs."
            )
            continue
        findings.append(_finding(scored, likely, before, test, may_name=sealed.may_name))
        before.append(scored.candidate)
        test.kept.append(_Kept(scored, likely))
    return findings


def _finding(
    scored: Scored,
    likely: Sequence[Probability],
    before: Sequence[Candidate],
    test: _Test,
    may_name: bool,
) -> Finding:
    candidate, cause = scored.candidate, scored.candidate.cause
    home = cause.place.home
    lead, covered, others = likely[0], likely[0].share, []
    for one in likely[1:]:
        if covered >= (SURE if not others else IN_SET):
            break
        covered += one.share
        others.append(one.family)
    unknown = isinstance(lead.best.candidate.cause, Function)
    if not may_name:
        verdict = "something_missing"
    elif unknown:
        verdict = "depends_on"
    else:
        verdict = "identified" if lead.share >= SURE else "one_of"
    old, new = test.squared(before), test.squared([*before, candidate])
    part = (home, "within")
    return Finding(
        balance=home,
        also_in=tuple(dict.fromkeys(e.equation for e in cause.place.enters if e.equation != home)),
        family=lead.family if may_name else "unknown",
        verdict=verdict,
        alternatives=tuple(others),
        depends_on=_variables(lead.best.candidate),
        confidence=None if unknown or not may_name else round(lead.share, 4),
        parameters=_parameters(scored),
        rmse_before=test.rmse(before, home),
        rmse_after=test.rmse([*before, candidate], home),
        runs_improved=int((new[part] < old[part]).sum()),
        runs_total=len(test.at),
        runs_affected=test.runs_affected(candidate),
    )


def _variables(candidate: Candidate) -> tuple[str, ...]:
    cause = candidate.cause
    if isinstance(cause, Function):
        return names(cause.place, cause.variables)
    found = [VARIABLE_OF_ROLE[r] for r, _ in cause.channels if r in VARIABLE_OF_ROLE]
    if cause.family == "friction.dwell":
        found = ["dwell" if v == "time" else v for v in found]
    signed = cause.family.startswith("friction.") and not cause.family.endswith(
        ("viscous_asymmetry", "drag", "stribeck", "load_viscous")
    )
    if signed:
        found = ["velocity_sign" if v == "velocity" else v for v in found]
    return tuple(dict.fromkeys(found))


def _parameters(scored: Scored) -> dict[str, Value]:
    cause = scored.candidate.cause
    if isinstance(cause, Function):
        return {}
    return {
        p.name: Value(float(x), p.unit, None)
        for p, x in zip(cause.effect.shape, cause.shape, strict=True)
    }
