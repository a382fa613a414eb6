"""A diagnosis in words: claims, sizes, competing hypotheses, and what to record next."""

import inspect
import math
import sys
from collections.abc import Sequence

from estimation.changes.difference import Change
from estimation.channels import PLAIN_UNIT, unit_or_none
from estimation.diagnosis.result import Diagnosis, Finding, Value, is_unexplained
from estimation.effects import catalogue
from estimation.plant_models import WORDS
from rig.output.table import counted

NO_NEXT = "None is proposed: no named hypotheses compete."
PART_OF_THE_NAME = "half the ", "share of a load of ", "fall of the ", "loss at the start "
"""What the description of a parameter begins with whose number is misread without it."""

SETTLING = {"sensor.drift.exponential": "time_constant", "sensor.drift.campaign": "time"}
"""Form of a drift that settles to the parameter that is the time of it."""

MEANS = ", the mean of each run included"
"""What errors are of, where the means of runs count."""

QUICK = "None was searched for: --quick does not search for one. Diagnose without it."


def sentences(diagnosis: Diagnosis) -> list[str]:
    """Return the result, one sentence a finding."""
    if not diagnosis.findings:
        runs = len(diagnosis.sealed.confirm)
        lines = [
            f"No unmodelled effect found in {', '.join(diagnosis.errors)}: no candidate"
            f" explained enough of the training runs and was confirmed on the {runs} held-out test"
            f" runs.{_above_noise(diagnosis)}"
        ]
    else:
        runs = len(diagnosis.sealed.discover) + len(diagnosis.sealed.confirm)
        lines = [
            _sentence(f, diagnosis.unit[f.error_of], diagnosis.exploratory) + _where(f, runs)
            for f in diagnosis.findings
        ]
    return lines + [f"{name}: not decided. {why}" for name, why in diagnosis.undecided.items()]


def lines(diagnosis: Diagnosis) -> list[str]:
    """Return everything that is said, one line each.

    The doubts about the recordings come first: a finding may be of what they name.
    """
    doubts, limits = said_of_recordings(diagnosis)
    return [*doubts, *sentences(diagnosis), *limits]


def said_of_recordings(diagnosis: Diagnosis) -> tuple[list[str], list[str]]:
    """Return the notes that are doubts about the recordings, and all others."""
    doubts = [note for note in diagnosis.notes if note.startswith("Check: ")]
    return doubts, [note for note in diagnosis.notes if note not in doubts]


def _above_noise(diagnosis: Diagnosis) -> str:
    """Return which errors are above the noise of the readings, and by what; empty if none is."""
    above = {name: r for name, r in diagnosis.over_noise.items() if is_unexplained(r)}
    if not above:
        return ""
    errors = ", ".join(f"{ratio:.2g} times that noise in {name}" for name, ratio in above.items())
    return f" Noise of the readings does not explain the error, which is {errors}."


def _sentence(finding: Finding, unit: str, exploratory: bool) -> str:
    scale, shown = display(unit, finding.rmse_before)
    tested = counted(finding.runs_total, "test run" if exploratory else "held-out test run")
    fall = (
        f"error{of_which(finding)} on {tested}{' (exploratory)' * exploratory}"
        f"{(MEANS + ':') * finding.with_means}"
        f" {scale * finding.rmse_before:.3g} -> {in_unit(scale * finding.rmse_after, shown)}"
        f" (lower in {finding.runs_improved} of {counted(finding.runs_total, 'run')})"
    )
    also = f" It also enters {', '.join(finding.also_in)}." if finding.also_in else ""
    return f"{finding.balance}: {_claim(finding)}; {fall}.{also}"


def of_which(finding: Finding) -> str:
    """Return the equation of the errors, if not the finding's."""
    return f" of {finding.error_of}" if finding.error_of != finding.balance else ""


def _where(finding: Finding, runs: int) -> str:
    """Return the runs in which a finding acts, unless it acts in all."""
    shown = finding.runs_affected
    if not 0 < len(shown) < runs:
        return ""
    return f" It acts in {len(shown)} of {runs} runs: {', '.join(shown)}."


def _claim(finding: Finding) -> str:
    if finding.verdict == "identified":
        return _named(finding)
    others = ", ".join(placed(finding, name) for name in finding.alternatives)
    also = f"; also possible: {others}; these runs cannot distinguish them" if others else ""
    if finding.verdict == "one_of":
        none = f", and no effect at all has {finding.no_effect:.0%}" * (finding.no_effect >= 0.01)
        if finding.no_effect > (finding.confidence or 0.0):  # of all names together, less
            none += f", next to {1.0 - finding.no_effect:.0%} of all effects together"
        return _named(finding) + (also or "; these runs are not enough to be sure of it") + none
    if finding.verdict == "depends_on":
        return f"unmodelled effect of unknown form; it depends on {variables_of(finding)}{also}"
    return "the model is incomplete, and the cause cannot be identified from these runs"


def variables_of(finding: Finding | Change) -> str:
    """Return the variables that a finding depends on, in words; empty where none is known."""
    return " and ".join(name.replace("_", " ") for name in finding.depends_on)


def placed(finding: Finding, alternative: str) -> str:
    """Return the name of an alternative, with its place where that is not the finding's.

    And with the finding's where only the alternative is of a sensor: of which one, is not clear.
    """
    place = finding.alternative_places.get(alternative, "")
    is_sensor = [name.startswith("sensor.") for name in (finding.family, alternative)]
    if not place and is_sensor == [False, True] and finding.place != finding.balance:
        place = finding.place
    return f"{alternative} ({place})" if place else alternative


def _named(finding: Finding) -> str:
    sizes = [f"{name} {text}".strip() for name, text in sizes_of(finding).items()]
    if finding.confidence is not None:
        sizes.append(f"confidence {confidence(finding.confidence)}")
    plain = meaning_of(finding)
    if finding.family == "sensor.crosstalk" and finding.depends_on:
        plain += f", the {variables_of(finding)}"
    places = " or ".join((finding.place, *finding.other_places))
    where = f" ({places})" if places != finding.balance else ""
    named = f"[{finding.family}]{where}" + (f", {', '.join(sizes)}" if sizes else "")
    if finding.family in WORDS:
        term = _first_line(finding.family).partition(": ")[0].lower()
        return f"declared term that differs between runs: {term} {named}"
    claim = " identified" if finding.verdict == "identified" else ", most likely"
    return f"unmodelled effect{claim}: {plain or finding.family} {named}"


def meaning_of(finding: Finding) -> str:
    """Return the meaning of the form that was found, in plain words; empty without a name."""
    known = catalogue().get(finding.form)
    plain = (known.meaning if known else "") or meaning(finding.family)
    condition = next((n for n in finding.depends_on if unit_or_none(n)), "its condition")
    return plain.replace("a stated condition of the runs", condition)


def meaning(name: str) -> str:
    """Return the meaning of a family with all its forms, in plain words; empty for no such one."""
    return _first_line(name).partition(": ")[2].removesuffix(".")


def _first_line(name: str) -> str:
    """Return the title and the meaning of an effect's file; empty for no such effect."""
    known = catalogue().get(name)
    lines = known and sys.modules[type(known).__module__].__doc__
    return (lines or "").partition("\n")[0]


def check_of(finding: Finding) -> str:
    """Return the checks at the rig for a finding, one sentence at least."""
    if finding.verdict in ("identified", "one_of"):
        names = (finding.form or finding.family, *finding.alternatives)
        checks = [advice(name) for name in names]
        if any(checks):
            return " Then: ".join(dict.fromkeys(c[0].upper() + c[1:] for c in checks if c))
    if variables := variables_of(finding):
        return (
            f"Find the part of the rig whose behaviour changes with {variables}: the residual below"
            " depends on it."
        )
    return (
        "These runs do not single out a part of the rig: record more, at other speeds, loads and"
        " positions."
    )


def advice(name: str) -> str:
    """Return the check at the rig in the description of an effect; empty without."""
    known = catalogue().get(name)
    text = inspect.getdoc(type(known)) or "" if known else ""
    check = next((p for p in text.split("\n\n") if p.startswith("Check: ")), "")
    return " ".join(check.removeprefix("Check: ").split())


def sizes_of(finding: Finding) -> dict[str, str]:
    """Return parameters with their units, sine and cosine of one wave as its amplitude."""
    left = dict(finding.parameters)
    sizes = {}
    if "lateness" in left:  # a part and its time are known by their product alone
        left = {"lateness": left["lateness"]}
    for harmonic in ("", "_1", "_2", "_3"):
        if f"sine{harmonic}" in left and f"cosine{harmonic}" in left:
            sine, cosine = left.pop(f"sine{harmonic}"), left.pop(f"cosine{harmonic}")
            size = _measured(math.hypot(sine.value, cosine.value), sine.unit)
            sizes[f"amplitude{harmonic}"] = size
    for name, known in left.items():
        sizes[label(finding.form or finding.family, name)] = _measured(known.value, known.unit)
    if (settling := SETTLING.get(finding.form, "")) in left:
        # a time far above that of a run is known by this quotient alone
        drift = left["drift"]
        rate = drift.value / left[settling].value
        scale, shown = display(drift.unit, rate)
        sizes["at first"] = f"{scale * rate:.3g} {shown}/s"
    if "order" in left:
        del sizes["order"]
        sizes |= wave(left["order"].value, finding.depends_on)
    return sizes


def label(effect: str, name: str) -> str:
    """Return the name of a parameter of an effect, with what it is half of or a share of."""
    known = catalogue().get(effect)
    for parameter in (*known.amplitudes, *known.shape) if known else ():
        if parameter.name == name and parameter.description.startswith(PART_OF_THE_NAME):
            return f"{name} ({parameter.description})"
    return name


def confidence(share: float) -> str:
    """Return a confidence in per cent; one that would round to all is stated as more than 99%."""
    return "more than 99%" if share >= 0.995 else f"{share:.0%}"


def with_period(finding: Finding) -> dict[str, Value]:
    """Return the parameters of a finding; the order of a wave along a travel as its period."""
    found = dict(finding.parameters)
    if "order" not in found or not _along(finding.depends_on).endswith("_position"):
        return found
    order = found["order"]
    low, high = order.ci95 or (math.nan, math.nan)
    turn = 2.0 * math.pi
    interval = (turn / high, turn / low) if 0 < low < high else None
    period = Value(turn / order.value, "m", interval)
    named = {k: ("period", period) if k == "order" else (k, v) for k, v in found.items()}
    return dict(named.values())


def _along(depends_on: Sequence[str]) -> str:
    """Return the variable that a wave repeats along; empty where it is not known."""
    return next((v for v in depends_on if v.endswith(("_angle", "_position"))), "")


def wave(order: float, depends_on: Sequence[str]) -> dict[str, str]:
    """Return how often a wave repeats, by name.

    So many times per turn of a shaft, which needs no name, or a period of a position.
    """
    along = _along(depends_on)
    if along.endswith("_position"):
        return {"period": f"{2.0 * math.pi / order:.3g} m"}
    if along:
        return {"": f"{order:.3g} per turn of the {along.replace('_', ' ')}"}
    return {"order": f"{order:.3g}"}


def _measured(value: float, unit: str) -> str:
    scale, shown = display(unit, value)
    return in_unit(scale * value, shown)


def in_unit(value: float, unit: str) -> str:
    """Return a value to three digits with its unit; a ratio has none."""
    return f"{value:.3g}" if unit == "1" else f"{value:.3g} {unit}"


def display(unit: str, size: float) -> tuple[float, str]:
    """Return the factor and the symbol that a unit is shown with, for values of a size in it."""
    return (1e3, "mN m") if unit == "N m" and abs(size) < 1.0 else (1.0, plain_unit(unit))


def plain_unit(unit: str) -> str:
    """Return a unit as people write it: kg of a mass, which follows as N s^2/m from channels."""
    return PLAIN_UNIT.get(unit, unit)


def other_sentences(diagnosis: Diagnosis) -> list[str]:
    """Return for each finding where it acts, what else fits, and what a technician checks."""
    return [
        f"{finding.balance}, {finding.family}: {_where_it_acts(finding)} {_others(finding)}"
        for finding in diagnosis.findings
    ]


def _where_it_acts(finding: Finding) -> str:
    kind, _, channel = finding.place.partition(" ")
    if kind == "sensor":
        return f"It is an error of the sensor of {channel}."
    if finding.place.startswith("torque at "):
        return f"It is a torque between {finding.place.removeprefix('torque at ')} and its load."
    if kind == "actuator":
        return f"It is in the actuator driven by {channel}."
    return f"It acts in the parts that the equation {finding.balance} describes."


def _others(finding: Finding) -> str:
    if finding.alternatives:
        likely = ", ".join(
            f"{placed(finding, name)} {finding.probabilities.get(name, 0.0):.0%}"
            for name in finding.alternatives
        )
        said = f"These also fit: {likely}."
    elif finding.family in catalogue():
        said = "Another effect of the catalogue does not fit as well."
    else:
        said = "A smooth function of its variables fits better than any effect of the catalogue."
    checks = {finding.family: advice(finding.form or finding.family)}
    checks |= {family: advice(family) for family in finding.alternatives}
    return " ".join([said, *(f"To check {name}: {text}" for name, text in checks.items() if text)])


def next_sentence(diagnosis: Diagnosis) -> str:
    """Return the next experiment and its reason."""
    proposed = diagnosis.next_experiment
    if proposed is None:
        competing = any(finding.alternatives for finding in diagnosis.findings)
        return QUICK if diagnosis.quick and competing else NO_NEXT
    between = proposed["between"]
    names = " from ".join(between) if len(between) == 2 else f"{', '.join(between)} from each other"
    if proposed["protocol"] is None:
        return f"To distinguish {names}: {proposed['description']}."
    others = ", ".join(f"{name} {value:.3g}" for name, value in proposed["others"].items())
    return (
        f"To distinguish {names}, record {proposed['name']!r}: {proposed['description']}"
        f" ({proposed['seconds']:.0f} s). Expected difference between the hypotheses:"
        f" {proposed['discrimination']:.3g} times the variance of the noise. Others: {others}."
    )
