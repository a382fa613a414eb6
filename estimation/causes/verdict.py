"""From the search's hypotheses to a diagnosis: names with probabilities, and errors on test runs.

The test runs take no part in the search. They are opened once, when every hypothesis is fixed.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from estimation.causes.candidates import Candidate
from estimation.causes.equations import Layout, lay_out, on_one_clock
from estimation.causes.folds import unvaried
from estimation.causes.functions import Function, names
from estimation.causes.held_out import HeldOut
from estimation.causes.instruments import add_instruments
from estimation.causes.numbers import DEFAULT, Numbers
from estimation.causes.refit import Errors, Part
from estimation.causes.refits import Refits
from estimation.causes.search import Found, Scored, posterior, probabilities, search
from estimation.diagnosis.audit import audit
from estimation.diagnosis.result import Diagnosis, Finding, Value
from estimation.diagnosis.split import LEAST_TO_NAME, Sealed
from estimation.model import Model, Term
from estimation.recording import Recording

SURE = 0.9
"""Probability from which a single name is given; below it the verdict is a set."""

IN_SET = 0.95
"""Probability that a set covers."""

LEAST_SHARE = 0.001
"""Probability from which a family is held against the test runs."""

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


@dataclass(frozen=True)
class Kept:
    """A cause that the test runs confirmed.

    Attributes:
        scored: The cause.
        likely: The probabilities of the families in its place.
        ranked: Every candidate in its place, given the other causes, best first.
        part: What it adds to its home equation.
    """

    scored: Scored
    likely: Sequence[Probability]
    ranked: Sequence[Scored]
    part: Part | None = None


@dataclass(frozen=True)
class Answer:
    """A diagnosis with what a report, a model file and the next experiment need.

    Attributes:
        diagnosis: The diagnosis.
        layout: The equations on all runs.
        found: The search on the training runs.
        kept: The cause of each finding.
        refits: The equations before and after.
        models: The models with the causes that a file can hold.
    """

    diagnosis: Diagnosis
    layout: Layout
    found: Found
    kept: tuple[Kept, ...]
    refits: Refits
    models: tuple[Model, ...]


def diagnose(
    recordings: Sequence[Recording],
    models: Sequence[Model],
    sealed: Sealed,
    numbers: Numbers = DEFAULT,
) -> Diagnosis:
    """Identify what the declared equations lack; see `answer`."""
    return answer(recordings, models, sealed, numbers).diagnosis


def answer(
    recordings: Sequence[Recording],
    models: Sequence[Model],
    sealed: Sealed,
    numbers: Numbers = DEFAULT,
    on_stage: Callable[[str], None] = lambda _: None,
) -> Answer:
    """Identify what the declared equations lack.

    Args:
        recordings: All runs.
        models: Declared equations.
        sealed: Which runs train and which test.
        numbers: What decides.
        on_stage: Called with what begins, in words.

    Raises:
        LayoutError: No equation can be laid out on these runs.
        FitError: A declared equation cannot be identified.
    """
    began = time.perf_counter()
    on_stage("fitting the declared equations")
    timed = on_one_clock(recordings)
    layout = lay_out(models, timed, sealed.discover)
    timed = [r for r in timed if r.name not in layout.left_out]
    sealed = sealed.without(layout.left_out)
    add_instruments(layout, sealed.discover)
    on_stage("searching the training runs for what they lack")
    with threadpool_limits(limits=1, user_api="blas"):  # threads wait for one another
        found = search(layout.select(sealed.discover), numbers)
    on_stage("opening the held-out test runs")
    refits = Refits(layout, timed, sealed, numbers)
    kept, findings, notes = _judged(found, HeldOut(layout, sealed, numbers, found.late), refits)
    written = refits.models()
    findings = [
        replace(f, parameters=_parameters(k, f.balance, written))
        for k, f in zip(kept, findings, strict=True)
    ]
    diagnosis = Diagnosis(
        findings=tuple(findings),
        errors=refits.errors(),
        unit={name: e.model.unit for name, e in layout.equations.items()},
        noise_floor=dict.fromkeys(layout.equations),
        moved={m.balance: _moved(layout.equations[m.balance].model, m) for m in written},
        sealed=sealed,
        undecided=dict(layout.undecided),
        notes=(*_limits(timed, layout, sealed), *notes),
        seconds=time.perf_counter() - began,
    )
    return Answer(diagnosis, layout, found, tuple(kept), refits, tuple(written))


def family_probabilities(ranked: Sequence[Scored], numbers: Numbers) -> list[Probability]:
    """Return the posterior over families of one slot, each by its best candidate, best first."""
    best: dict[str, Scored] = {}
    for scored in ranked:
        best.setdefault(scored.candidate.cause.family, scored)
    shares = posterior(list(best.values()), numbers)
    found = [Probability(f, float(p), best[f]) for f, p in zip(best, shares, strict=True)]
    return sorted((p for p in found if p.share > 0.0), key=lambda p: -p.share)


def _judged(
    found: Found, held_out: HeldOut, refits: Refits
) -> tuple[list[Kept], list[Finding], list[str]]:
    """Return the causes that the test runs confirm, their findings, and notes on the others."""
    numbers, sealed = refits.numbers, refits.sealed
    kept: list[Kept] = []
    findings: list[Finding] = []
    confirmed, notes = _confirmed(found, held_out, numbers)
    for one in confirmed:
        cause = one.scored.candidate.cause
        earlier = [k.scored.candidate for k in kept]
        acts_in, settled = held_out.acts_in(earlier, one.scored.candidate)
        if settled:
            counted = one.scored.candidate.acts is not None
            refits.open |= set() if counted else {*settled}
            notes.append(
                f"{', '.join(settled)}: the training runs do not show whether {cause.family} acts"
                " there; "
                + ("these test runs themselves do." if counted else "not counted in the errors.")
            )
        home = cause.place.home
        entered = dict.fromkeys(e.equation for e in cause.place.enters)
        known = dict(refits.parts)
        before = {name: refits.test_errors(name) for name in entered}
        refits.add(one.scored.candidate, acts_in)
        after = {name: refits.test_errors(name) for name in entered}
        if not any(_is_lower(before[name], after[name], numbers) for name in entered):
            refits.parts = known
            notes.append(
                f"{cause.family} ({cause.place.name}) was found in the training runs and does not"
                " lower the error on the test runs."
            )
            continue
        finding = _named(one, sealed.may_name)
        findings.append(
            replace(
                finding,
                rmse_before=before[home].rmse,
                rmse_after=after[home].rmse,
                runs_improved=sum(
                    after[home].by_run[n] < x for n, x in before[home].by_run.items()
                ),
                runs_total=len(before[home].by_run),
                runs_affected=tuple(name for name, acts in acts_in.items() if acts),
            )
        )
        part = refits.parts[home][-1]
        kept.append(replace(one, part=part))
        if not part.is_written:
            notes.append(_unwritten(one.scored.candidate))
    return kept, findings, notes


def _confirmed(found: Found, held_out: HeldOut, numbers: Numbers) -> tuple[list[Kept], list[str]]:
    """Return the causes with evidence on the test runs next to the others, and notes on the rest.

    The one with the least evidence goes first: two effects may need one another.
    """
    left, notes = list[Kept](), list[str]()
    for ranked in found.conditional:
        likely = family_probabilities(ranked, numbers)
        left.append(Kept(likely[0].best, likely, ranked))
    while left:
        tested = [
            _tested(one, [o.scored.candidate for o in left if o is not one], held_out, numbers)
            for one in left
        ]
        least = min(range(len(left)), key=lambda k: tested[k][1])
        if tested[least][1] >= math.log(numbers.kept_evidence):
            return [one for one, _ in tested], notes
        cause = left.pop(least).scored.candidate.cause
        notes.append(
            f"{cause.family} ({cause.place.name}) was found in the training runs and not"
            " confirmed on the test runs."
        )
    return [], notes


def _tested(
    one: Kept, others: Sequence[Candidate], held_out: HeldOut, numbers: Numbers
) -> tuple[Kept, float]:
    """Return a cause with probabilities from all runs, and the log e-value of the test runs.

    The e-value is the mean over the families, by their probabilities on the training runs.
    Each of these families then has the mean gain over all runs; the test runs add no family.
    """
    known = [p for p in one.likely if p.share >= LEAST_SHARE]
    count, train = len(held_out.layout.runs), len(held_out.layout.runs) - len(held_out.at)
    gains, logs = np.array([(p.best.gain, 0.0) for p in known]).T
    for k, p in enumerate(known):
        of_runs = held_out.gains(others, p.best.candidate)
        logs[k] = of_runs.log_ratio(0.5 * numbers.samples_a_run)
        rate = numbers.sharpness / count
        gains[k] = (train * gains[k] + of_runs.log_ratio(rate) / rate) / count
    shares = np.array([p.share for p in known])
    total = float(np.logaddexp.reduce(np.log(shares / shares.sum()) + logs))
    prices = np.array([p.best.gain - p.best.score for p in known])
    weights = probabilities(gains - prices, gains, numbers.sharpness)
    found = sorted(
        (replace(p, share=float(w)) for p, w in zip(known, weights, strict=True)),
        key=lambda p: -p.share,
    )
    return replace(one, scored=found[0].best, likely=found), total


def _set_of(likely: Sequence[Probability]) -> list[str]:
    """Return the families besides the first that a verdict lists."""
    some, covered = sum(p.share for p in likely), likely[0].share
    others: list[str] = []
    for one in likely[1:]:
        if covered >= (IN_SET if others else SURE) * some:
            break
        covered += one.share
        others.append(one.family)
    return others


def _is_lower(before: Errors, after: Errors, numbers: Numbers) -> bool:
    """Whether an error on the test runs falls, with each run's mean removed or left in."""
    least = math.sqrt(1.0 - numbers.form_floor)
    return (
        after.rmse <= least * before.rmse or after.rmse_with_means <= least * before.rmse_with_means
    )


def _unwritten(candidate: Candidate) -> str:
    cause = candidate.cause
    if candidate.acts is not None:
        why = "it acts in some of the runs only"
    elif isinstance(cause, Function):
        why = "its form is unknown"
    else:
        why = f"it needs a reading that no model of {cause.place.home} may use"
    return f"{cause.place.home}: {cause.family} is reported and not added to the model file; {why}."


def _named(one: Kept, may_name: bool) -> Finding:
    """Return the claim of a cause, without its errors."""
    cause = one.scored.candidate.cause
    home = cause.place.home
    lead, others = one.likely[0], _set_of(one.likely)
    unknown = isinstance(lead.best.candidate.cause, Function)
    if not may_name:
        verdict = "something_missing"
    elif unknown:
        verdict = "depends_on"
    else:
        verdict = "identified" if lead.share >= SURE else "one_of"
    return Finding(
        balance=home,
        also_in=tuple(dict.fromkeys(e.equation for e in cause.place.enters if e.equation != home)),
        place=cause.place.name,
        family=lead.family if may_name else "unknown",
        verdict=verdict,
        alternatives=tuple(others) if may_name else (),
        probabilities={p.family: round(p.share, 4) for p in one.likely[: 1 + len(others)]}
        if may_name
        else {},
        depends_on=_variables(lead.best.candidate),
        confidence=None if unknown or not may_name else round(lead.share, 4),
        rmse_before=float("nan"),
        rmse_after=float("nan"),
        runs_improved=0,
        runs_total=0,
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


def _parameters(kept: Kept, home: str, written: Sequence[Model]) -> Mapping[str, Value]:
    """Return amplitudes and shape of a named cause from the written model of its home equation.

    Of a cause that no file holds, the shape alone.
    """
    cause = kept.scored.candidate.cause
    if isinstance(cause, Function):
        return {}
    model = next(m for m in written if m.balance == home)
    own = kept.part.term if kept.part is not None else None
    for term in model.terms if own is not None else ():
        if own is not None and _same(term, own):
            return {
                p.name: Value(known.value, term.unit(p, model.target), known.ci95)
                for p in term.parameters
                for known in [term.values[p.name]]
            }
    units = Term(cause.effect, channels=dict(cause.channels))
    return {
        p.name: Value(float(x), units.unit(p, model.target), None)
        for p, x in zip(cause.effect.shape, cause.shape, strict=True)
    }


def _same(one: Term, other: Term) -> bool:
    """Whether two terms are of one effect at one shape."""
    shape = one.effect.shape
    return one.effect.id == other.effect.id and one.numbers(shape) == other.numbers(shape)


def _moved(before: Model, after: Model) -> dict[str, dict[str, float]]:
    """Return the declared parameters before and after the findings."""
    out = {}
    for old, new in zip(before.terms, after.terms, strict=False):
        for p in old.parameters:
            key = f"{old.effect.id}.{p.name}"
            out[key] = {"before": old.values[p.name].value, "after": new.values[p.name].value}
    return out


def _limits(recordings: Sequence[Recording], layout: Layout, sealed: Sealed) -> list[str]:
    """Return the limits of these runs, one sentence each."""
    training = [r for r in recordings if r.name in sealed.discover]
    found = audit(training)
    if not sealed.may_name:
        found.append(
            f"{len(sealed.discover)} training runs: with fewer than {LEAST_TO_NAME} no effect is"
            " named."
        )
    found += [f"Left out: {reason}" for reason in layout.left_out.values()]
    found += [
        f"All training runs are at one level of {condition}: an effect that depends on it cannot"
        " be distinguished from one that does not."
        for condition in unvaried(layout.select(sealed.discover))
    ]
    return found
