"""A diagnosis in words: claims, sizes, competing hypotheses, and what to record next."""

import inspect
import math
import sys
from collections.abc import Mapping

from estimation.diagnosis.result import Diagnosis, Finding, Value
from estimation.effects import catalogue

NO_NEXT = "None is proposed: there are no competing hypotheses to distinguish."


def sentences(diagnosis: Diagnosis) -> list[str]:
    """Return the result, one sentence a finding."""
    if not diagnosis.findings:
        runs = len(diagnosis.sealed.confirm)
        lines = [
            f"No unmodelled effect found in {', '.join(diagnosis.errors)}: no candidate met the"
            f" acceptance criteria and was confirmed on the {runs} held-out test runs."
        ]
    else:
        which = "test runs used before" if diagnosis.exploratory else "held-out test runs"
        runs = len(diagnosis.sealed.discover) + len(diagnosis.sealed.confirm)
        lines = [
            _sentence(f, diagnosis.unit[f.balance], which) + _where(f, runs)
            for f in diagnosis.findings
        ]
    return lines + [f"{name}: not decided. {why}" for name, why in diagnosis.undecided.items()]


def _sentence(finding: Finding, unit: str, which: str) -> str:
    scale, shown = display(unit)
    fall = (
        f"error on {finding.runs_total} {which}"
        f" {scale * finding.rmse_before:.3g} -> {scale * finding.rmse_after:.3g} {shown}"
        f" (lower in {finding.runs_improved} of {finding.runs_total} runs)"
    )
    also = f" It also shows in {', '.join(finding.also_in)}." if finding.also_in else ""
    form = (
        f" A correction term {finding.form} (SI units) improves this effect's equation further; it"
        " is included in the reported error."
        if finding.form
        else ""
    )
    return f"{finding.balance}: {_claim(finding)}; {fall}.{also}{form}{_formula(finding, unit)}"


def _where(finding: Finding, runs: int) -> str:
    """Return the runs a finding affects, where a third of them and more are not affected."""
    shown = finding.runs_affected
    if not 0 < 3 * len(shown) <= 2 * runs:
        return ""
    return f" It affects {len(shown)} of {runs} runs: {', '.join(shown)}."


def _formula(finding: Finding, unit: str) -> str:
    """Return the formula that a model file holds, in words; empty without one."""
    if not finding.formulas:
        return ""
    best = finding.formulas[0]
    scale, shown = display(unit)
    left = "" if best.rmse_after is None else f", error {scale * best.rmse_after:.3g} {shown}"
    more = len(finding.formulas) - 1
    others = f"; {more} more fit about equally well" if more else ""
    return f" Formula: {best.text} (SI units){left}{others}."


def _claim(finding: Finding) -> str:
    words = " and ".join(v.replace("_", " ") for v in finding.depends_on)
    if finding.verdict == "identified":
        return _named(finding)
    if finding.verdict == "one_of":
        others = ", ".join(finding.alternatives) or "another effect"
        return (
            f"{_named(finding)}; {others} fits equally well, and these runs cannot distinguish them"
        )
    if finding.verdict == "depends_on":
        return f"unmodelled effect of unknown form; it depends on {words}"
    return "the model is incomplete, and the cause cannot be identified from these runs"


def _named(finding: Finding) -> str:
    sizes = [f"{name} {text}" for name, text in sizes_of(finding.parameters).items()]
    if finding.confidence is not None:
        sizes.append(f"confidence {finding.confidence:.0%}")
    plain = meaning(finding.family)
    size = f", {', '.join(sizes)}" if sizes else ""
    return f"unmodelled effect identified: {plain or finding.family} [{finding.family}]{size}"


def meaning(family: str) -> str:
    """Return what a family of the catalogue is, in plain words; empty for no such family."""
    known = catalogue().get(family)
    lines = known and sys.modules[type(known).__module__].__doc__
    first = (lines or "").partition("\n")[0]
    return first.partition(": ")[2].removesuffix(".")


def check_of(finding: Finding) -> str:
    """Return what to check at the rig for a finding, one sentence at least."""
    if finding.verdict in ("identified", "one_of"):
        checks = [_check(family) for family in (finding.family, *finding.alternatives)]
        if any(checks):
            return " Then: ".join(dict.fromkeys(check for check in checks if check))
    words = " and ".join(v.replace("_", " ") for v in finding.depends_on)
    if words:
        return (
            f"Find the part of the rig whose behaviour changes with {words}: the residual below"
            " depends on it. Then record the next experiment."
        )
    return "Record the next experiment: these runs do not single out a part of the rig."


def _check(family: str) -> str:
    """Return the advice in the description of an effect; empty without."""
    known = catalogue().get(family)
    text = inspect.cleandoc(type(known).__doc__ or "") if known else ""
    checks = [p for p in text.split("\n\n") if p.startswith("Check: ")]
    if not checks:
        return ""
    advice = " ".join(checks[0].removeprefix("Check: ").split())
    return advice[0].upper() + advice[1:]


def sizes_of(parameters: Mapping[str, Value]) -> dict[str, str]:
    """Return parameters with their units, sine and cosine of one wave as its amplitude."""
    left = dict(parameters)
    sizes = {}
    if "sine" in left and "cosine" in left:
        sine, cosine = left.pop("sine"), left.pop("cosine")
        scale, unit = display(sine.unit)
        sizes["amplitude"] = _measured(scale * math.hypot(sine.value, cosine.value), unit)
    for name, known in left.items():
        scale, unit = display(known.unit)
        sizes[name] = _measured(scale * known.value, unit)
    return sizes


def _measured(value: float, unit: str) -> str:
    return f"{value:.3g}" if unit == "1" else f"{value:.3g} {unit}"


def display(unit: str) -> tuple[float, str]:
    """Return the factor and the symbol that a unit is shown with."""
    return (1e3, "mN m") if unit == "N m" else (1.0, unit)


def other_sentences(diagnosis: Diagnosis) -> list[str]:
    """Return the competing hypotheses of each finding, and what distinguishes them."""
    return [
        f"{finding.balance}, {finding.family}: {_others(finding)}" for finding in diagnosis.findings
    ]


def _others(finding: Finding) -> str:
    known = catalogue().get(finding.family)
    if known is None:
        return "a non-parametric function of its variables fits better than any known effect."
    if finding.alternatives:
        said = f"on these runs {', '.join(finding.alternatives)} fits about equally well."
    else:
        said = "on these runs no other effect of the catalogue fits equally well."
    if known.confused_with:
        said += f" It resembles {', '.join(known.confused_with)}"
        said += f"; to distinguish them: {known.told_apart_by}." if known.told_apart_by else "."
    return said


def next_sentence(diagnosis: Diagnosis) -> str:
    """Return the next experiment and its reason."""
    proposed = diagnosis.next_experiment
    if proposed is None:
        return NO_NEXT
    rivals = (
        " from ".join(proposed["between"][:2])
        if len(proposed["between"]) == 2
        else (", ".join(proposed["between"]) + " from each other")
    )
    if proposed["protocol"] is None:
        return f"To distinguish {rivals}: {proposed['description']}."
    others = ", ".join(f"{name} {value:.3g}" for name, value in proposed["others"].items())
    return (
        f"To distinguish {rivals}, record {proposed['name']!r}: {proposed['description']}"
        f" ({proposed['seconds']:.0f} s). Expected variance ratio between the hypotheses and the"
        f" noise: {proposed['discrimination']:.3g}. Alternatives: {others}."
    )
