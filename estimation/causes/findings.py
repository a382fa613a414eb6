"""The findings of a diagnosis: what is claimed of a cause, and its parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from estimation.causes.acting import Moved
from estimation.causes.addition import Addition
from estimation.causes.candidates import Candidate
from estimation.causes.equations import sensitivity
from estimation.causes.functions import Function, name_of_channel, names
from estimation.causes.numbers import Numbers
from estimation.causes.refits import Refits
from estimation.causes.scoring import Scored, posterior
from estimation.causes.sources import LATE, Source
from estimation.causes.unsteady import Unsteady
from estimation.channels import ending_of
from estimation.diagnosis.result import Finding, Value
from estimation.effects import Proportional
from estimation.model import Model, Term

SURE = 0.9
"""Probability from which a single name is given; below it the verdict is a set."""

IN_SET = 0.95
"""Share of the probability of all effects that a set covers."""

VARIABLE_OF_ROLE: Mapping[str, str] = {
    "speed": "velocity",
    "acceleration": "acceleration",
    "load": "load",
    "reading": "load",
    "creeping": "load",
    "current": "current",
    "drive": "current",
    "source": "current",
    "clock": "time",
    "elapsed": "time",
    "campaign_clock": "time",
    "travel": "history",
    "temperature": "temperature",
}
"""Role of an effect to the variable that a finding names."""

BY_CHANNEL = (
    "position",
    "output_angle",
    "motor_angle",
    "turning_angle",
    "encoder",
    "stop",
    "tilt",
    "condition",
)
"""Roles of an angle, a position or a condition, which a finding names by its channel."""

OTHER_ROLES = ("other_reading", "other_angle", "other_torque")
"""Roles of a quantity of elsewhere, which a finding names by its channel without the unit."""


@dataclass(frozen=True)
class Probability:
    """A family's share of the posterior in one slot of the leading hypothesis.

    The gain is that of its best candidate, before the price of what was chosen: over the training
    runs, or over all runs once the test runs are opened.
    """

    family: str
    share: float
    best: Scored
    gain: float


@dataclass(frozen=True)
class Kept:
    """A cause that the test runs confirmed, with the families and all candidates in its place.

    They are given the other causes, best first. The part is what it adds to its home equation,
    `shown` what it adds to that whose error is stated.
    """

    scored: Scored
    likely: Sequence[Probability]
    ranked: Sequence[Scored]
    part: Addition | None = None
    shown: Addition | None = None


def family_probabilities(ranked: Sequence[Scored], numbers: Numbers) -> list[Probability]:
    """Return the posterior over families of one slot, each by its best candidate, best first."""
    best: dict[str, Scored] = {}
    for scored in ranked:
        best.setdefault(scored.candidate.cause.family, scored)
    shares = posterior(list(best.values()), numbers)
    found = [
        Probability(f, float(p), best[f], best[f].gain) for f, p in zip(best, shares, strict=True)
    ]
    return sorted((p for p in found if p.share > 0.0), key=lambda p: -p.share)


def _other_places(family: str, ranked: Sequence[Scored], numbers: Numbers) -> tuple[str, ...]:
    """Return the places besides the best one where a family is as likely, best first."""
    best: dict[str, Scored] = {}
    for scored in ranked:
        if scored.candidate.cause.family == family:
            best.setdefault(scored.candidate.cause.place.name, scored)
    shares = posterior(list(best.values()), numbers)
    whole = float(shares.sum())
    if not whole:
        return ()
    return tuple(others_in_set(next(iter(best)), dict(zip(best, shares / whole, strict=True))))


def named(one: Kept, may_name: bool, numbers: Numbers) -> Finding:
    """Return the claim of a cause, without its errors."""
    place, lead = one.scored.candidate.cause.place, one.likely[0]
    finding = Finding(
        balance=place.home,
        also_in=tuple(name for name in place.equations if name != place.home),
        place=place.name,
        family="unknown",
        verdict="something_missing",
        depends_on=variables_of(lead.best.candidate),
        error_of=place.home,
    )
    if not may_name:
        return finding
    others = others_in_set(lead.family, {p.family: p.share for p in one.likely})
    claimed = replace(
        finding,
        family=lead.family,
        alternatives=tuple(others),
        alternative_places={
            p.family: where
            for p in one.likely
            for where in [p.best.candidate.cause.place.name]
            if p.family in others and where != place.name
        },
        other_places=_other_places(lead.family, one.ranked, numbers),
        probabilities={p.family: round(p.share, 4) for p in one.likely[: 1 + len(others)]},
        no_effect=round(max(0.0, 1.0 - sum(p.share for p in one.likely)), 4),
    )
    cause = lead.best.candidate.cause
    if isinstance(cause, Function):
        return replace(claimed, verdict="depends_on")
    claimed = replace(claimed, form=cause.effect.id)
    verdict = "identified" if lead.share >= SURE else "one_of"
    return replace(claimed, verdict=verdict, confidence=round(lead.share, 4))


def unpredicted(found: Unsteady, refits: Refits) -> Finding:
    """Return the finding of a friction level that changes within runs."""
    before = refits.test_errors(found.equation)
    return Finding(
        balance=found.equation,
        place=found.equation,
        family="unknown",
        verdict="depends_on",
        depends_on=("velocity" if found.effect.endswith("viscous") else "velocity_sign",),
        error_of=found.equation,
        rmse_before=before.rmse,
        rmse_after=found.fall * before.rmse,
        runs_improved=sum(found.by_run[name] > 0.0 for name in before.by_run),
        runs_total=len(before.by_run),
        runs_affected=tuple(name for name, gain in found.by_run.items() if gain > 0.0),
    )


def parameters_of(
    kept: Kept, finding: Finding, written: Sequence[Model], refits: Refits
) -> Mapping[str, Value]:
    """Return amplitudes and shape of a named cause from the written model of its home equation.

    Of a declared term, its change; of another cause that no file holds, the amplitudes of the
    refit, without intervals. Of what is late, also by how much: a delay or a lag of part of a
    reading shows in slow motion by the product of that part and its time alone.
    """
    found = _amplitudes_and_shape(kept, finding, written, refits)
    cause = kept.scored.candidate.cause
    if isinstance(cause, Moved | Function) or cause.effect.id not in LATE:
        return found
    names = [p.name for p in (*cause.effect.amplitudes, *cause.effect.shape)]
    if not found.keys() >= {*names}:  # a declared term has that amplitude too
        return found
    gain, late = (found[name] for name in names)
    whole = 1.0
    if kept.part is not None and kept.part.term is not None:  # in the unit of the equation
        own = (e for e in cause.place.enters if e.equation == finding.balance and not e.order)
        whole = abs(next(e.gain for e in own if e.gain))
    return {"lateness": Value(abs(gain.value) / whole * late.value, late.unit, None), **found}


def _amplitudes_and_shape(
    kept: Kept, finding: Finding, written: Sequence[Model], refits: Refits
) -> Mapping[str, Value]:
    cause, home = kept.scored.candidate.cause, finding.balance
    if isinstance(cause, Function):
        return {}
    model = next(m for m in written if m.balance == home)
    if isinstance(cause, Moved) and kept.part is not None:  # in the runs in which it acts
        (k,) = cause.parts
        moved = Term(cause.effect, channels=dict(cause.channels))
        unit = "1" if cause.of_all else moved.unit(cause.effect.amplitudes[k], model.target)
        amplitude = float(refits.of[home].amplitudes(kept.part, refits.parts[home])[k])
        if cause.is_gain and model.target in cause.reads:  # of what the equation predicts for it
            return {"change": Value(cause.change_from_usual(amplitude), unit, None)}
        acting = [run for run in refits.layout.runs if run.name in finding.runs_affected]
        return {"change": Value(cause.change(amplitude, acting), unit, None)}
    if (term := written_term(kept, model)) is not None:
        values = term.values
        return {
            p.name: Value(values[p.name].value, term.unit(p, model.target), values[p.name].ci95)
            for p in term.parameters
        }
    units = Term(cause.effect, channels=dict(cause.channels))
    shape = {
        p.name: Value(float(x), units.unit(p, model.target), None)
        for p, x in zip(cause.effect.shape, cause.shape, strict=True)
    }
    if in_sensor := _in_sensor(kept, finding, refits):
        return {**in_sensor, **shape}
    return {**_refitted(kept, home, refits), **shape}


def _in_sensor(kept: Kept, finding: Finding, refits: Refits) -> Mapping[str, Value]:
    """Return the amplitudes of a sensor's error from the equation whose error it lowers most.

    In its home equation they are not identified: crosstalk of the current is a larger constant of
    the drive. They are in the unit of the sensor.
    """
    cause, name, part = kept.scored.candidate.cause, finding.error_of, kept.shown
    if isinstance(cause, Function) or part is None or part.term is None or name == finding.balance:
        return {}
    gains = [abs(e.gain) for e in cause.place.enters if e.equation == name and not e.order]
    if cause.place.kind != "torque sensor" or not gains or not sum(gains):
        return {}
    values = refits.of[name].amplitudes(part, refits.parts[name]) / sum(gains)
    target = cause.place.name.removeprefix("sensor ")
    return {
        p.name: Value(float(x), part.term.unit(p, target), None)
        for p, x in zip(part.term.effect.amplitudes, values, strict=True)
    }


def written_term(kept: Kept, model: Model) -> Term | None:
    """Return the term of a written model that a cause is; None where the model has none."""
    own = kept.part.term if kept.part is not None else None
    return next((t for t in model.terms if own is not None and _same(t, own)), None)


def _refitted(kept: Kept, home: str, refits: Refits) -> Mapping[str, Value]:
    """Return the amplitudes of a cause in the refit of its home equation.

    An error of a sensor that enters by its rates alone is in the unit of the sensor. An amplitude
    that a declared term of the same family has too is left out: their sum alone is known.
    """
    cause, part, model = kept.scored.candidate.cause, kept.part, refits.of[home].model
    if part is None or isinstance(cause, Function):
        return {}
    term = part.term or Term(cause.effect, channels=dict(cause.channels))
    own: Sequence[int] = range(len(term.effect.amplitudes)) if part.term else cause.parts
    target = model.target
    if part.term is None and cause.place.kind in ("angle sensor", "torque sensor"):
        target = cause.place.name.removeprefix("sensor ")
    declared = {
        p
        for other in model.terms
        if (other.effect.family, other.channels) == (term.effect.family, term.channels)
        for p in other.effect.amplitudes
    }
    names = [term.effect.amplitudes[k] for k in own]
    values = refits.of[home].amplitudes(part, refits.parts[home])
    if part.term is None and cause.place.kind == "angle sensor":
        values = values * _gain_before(cause, refits, home)
    return {
        p.name: Value(float(x), term.unit(p, target), None)
        for p, x in zip(names, values, strict=True)
        if p not in declared
    }


def _gain_before(cause: Source, refits: Refits, equation: str) -> float:
    """Return the gain of a reading's error that its columns have, of that next to them.

    The error of an angle enters by the inertia that the equation has without it, which is too small
    or too large for just that reason.
    """
    declared, solved = refits.layout.equations[equation], refits.after(equation)
    orders: dict[str, int] = {}
    for name in declared.channels:
        if (found := sensitivity(name, cause.reads[0], declared.model.signals)) is not None:
            orders[name] = found[1]
    if not orders:
        return 1.0
    highest, after, at = max(orders, key=lambda name: orders[name]), 0.0, 0
    for term in solved.declared:
        if isinstance(term.effect, Proportional) and highest in term.channels.values():
            after += term.sign * float(solved.weights[at])
        at += len(term.effect.amplitudes)
    return declared.channels[highest] / after if after else 1.0


def others_in_set(name: str, shares: Mapping[str, float]) -> list[str]:
    """Return the names besides one that a verdict lists, of all with their probabilities.

    A sure name has none. What is left of all probability is that of no effect.
    """
    covered, others = shares[name], list[str]()
    for other, share in shares.items() if covered < SURE else ():
        if other != name and covered < IN_SET * sum(shares.values()):
            others.append(other)
            covered += share
    return others


def variables_of(candidate: Candidate) -> tuple[str, ...]:
    """Return the variables that a cause depends on, as a finding names them."""
    cause = candidate.cause
    if isinstance(cause, Function):
        return names(cause.place, cause.variables)
    found = [name for role, channel in cause.channels if (name := _variable(role, channel))]
    if cause.family == "friction.dwell":
        found = ["dwell" if v == "time" else v for v in found]
    follows_speed = ".viscous" in cause.effect.id or cause.family.endswith(
        ("viscous_asymmetry", "drag", "stribeck", "load_viscous")
    )
    if cause.family.startswith("friction.") and not follows_speed:
        found = ["velocity_sign" if v == "velocity" else v for v in found]
    return tuple(dict.fromkeys(found))


def _variable(role: str, channel: str) -> str:
    """Return the variable that a finding names for a channel in a role; empty for none."""
    if role in BY_CHANNEL:
        return name_of_channel(channel)
    if role in OTHER_ROLES:
        return channel.removesuffix(f"_{ending_of(channel)}")
    return VARIABLE_OF_ROLE.get(role, "")


def _same(one: Term, other: Term) -> bool:
    shape = one.effect.shape
    return one.effect.id == other.effect.id and one.numbers(shape) == other.numbers(shape)
