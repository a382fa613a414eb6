"""A diagnosis on one page: the sentence, the plots, the numbers, and its limits."""

import math
from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from estimation.causes.functions import Function
from estimation.causes.verdict import VARIABLE_OF_ROLE, Answer, Kept
from estimation.channels import unit_of
from estimation.diagnosis.result import Diagnosis, Finding, Value
from estimation.recording import FloatArray
from rig.diagnosis.run import Diagnosed
from rig.output import figures
from rig.output.provenance import Provenance
from rig.output.render import render
from rig.output.table import TextTable
from rig.reports.diagnosis_words import display, next_sentence, other_sentences, sentences

CONFIDENCE = (
    "Confidence is the posterior probability of the name among all candidates. It is not calibrated"
    " yet; answers that were sure and wrong are counted in docs/results/diagnosis-versions.md."
)


SHOWN = 8
"""Alternatives in a table."""


def page(done: Diagnosed, provenance: Provenance) -> str:
    """Return the page of HTML."""
    diagnosis = done.diagnosis
    sealed = done.sealed
    story = (
        f"{len(sealed.discover)} training runs, {len(sealed.confirm)} held-out test runs"
        f" ({', '.join(sealed.confirm)}); chosen by seed {sealed.seed} before any fit, fingerprint"
        f" {sealed.seal[:12]}, data {sealed.data_hash[:12]}. It took {diagnosis.seconds:.0f} s."
    )
    drawn: list[tuple[str, Markup]] = []
    for finding, kept in zip(diagnosis.findings, done.answer.kept, strict=True):
        drawn += _over_variable(done.answer, finding, kept)
    for name in diagnosis.errors:
        drawn.append(_by_run(diagnosis, name))
    return render(
        "diagnosis.html",
        {
            "title": f"Diagnosis: {diagnosis.verdict.replace('_', ' ')}",
            "sentences": sentences(diagnosis),
            "story": story,
            "figures": drawn,
            "tables": tables(done),
            "others": other_sentences(diagnosis),
            "limits": [*diagnosis.notes, CONFIDENCE],
            "next_experiment": next_sentence(diagnosis),
            "provenance": provenance,
        },
    )


def tables(done: Diagnosed) -> list[TextTable]:
    """Return the tables of the page."""
    shown = [_errors(done.diagnosis)]
    if any(f.parameters for f in done.diagnosis.findings):
        shown.append(_parameters(done.diagnosis.findings))
    for finding, kept in zip(done.diagnosis.findings, done.answer.kept, strict=True):
        shown.append(_tried(finding, kept))
    shown += [_moved(done.diagnosis, name, done.answer) for name in done.diagnosis.errors]
    return shown


def _errors(diagnosis: Diagnosis) -> TextTable:
    rows = []
    for name, error in diagnosis.errors.items():
        scale, unit = display(diagnosis.unit[name])
        low, high = error.ratio_ci95
        values = (error.before, error.after, error.with_means_before, error.with_means_after)
        rows.append([name, *(f"{scale * v:.3g}" for v in values), f"{low:.2f} to {high:.2f}", unit])
    columns = ["equation", "before", "after", "with means, before", "after", "after/before", "unit"]
    return TextTable(
        "Error on the held-out test runs",
        columns,
        rows,
        "Root mean square over all valid samples, those at rest too; each run's mean removed, then"
        " with the means left in."
        " Ratio: 95 % interval of a bootstrap over runs.",
    )


def _parameters(findings: Sequence[Finding]) -> TextTable:
    rows = [
        [f"{finding.balance}, {finding.family}, {name}", *_with_interval(known)]
        for finding in findings
        for name, known in finding.parameters.items()
    ]
    columns = ["parameter", "value", "95 %", "unit"]
    return TextTable("Parameters of what was found", columns, rows, "Bootstrap over runs.")


def _with_interval(known: Value) -> list[str]:
    """Return value, interval and unit, with the digits that the interval supports."""
    scale, unit = display(known.unit)
    if known.ci95 is None or not known.ci95[1] > known.ci95[0]:
        return [f"{scale * known.value:.4g}", "", unit]
    low, high = (scale * end for end in known.ci95)
    places = max(0, 1 - math.floor(math.log10(high - low)))
    return [f"{scale * known.value:.{places}f}", f"{low:.{places}f} to {high:.{places}f}", unit]


def _tried(finding: Finding, kept: Kept) -> TextTable:
    rows = []
    for likely in kept.likely[:SHOWN]:
        cause = likely.best.candidate.cause
        what = likely.family
        if isinstance(cause, Function):
            what += f" function of {', '.join(cause.variables)}"
        rows.append(
            [f"{what}, {cause.place.name}", f"{likely.share:.3f}", f"{likely.best.score:.3f}"]
        )
    return TextTable(
        f"What was tried in place of {finding.family} in {finding.balance}",
        ["cause, place", "probability", "score"],
        rows,
        "Score: log ratio of errors on training runs and conditions left out, less the price of the"
        " choice. The other findings are part of the model.",
    )


def _moved(diagnosis: Diagnosis, name: str, answer: Answer) -> TextTable:
    model = answer.layout.equations[name].model
    units = {
        f"{term.effect.id}.{parameter.name}": term.unit(parameter, model.target)
        for term in model.terms
        for parameter in term.parameters
    }
    rows = []
    for key, value in diagnosis.moved[name].items():
        scale, unit = display(units.get(key, ""))
        rows.append([key, f"{scale * value['before']:.4g}", f"{scale * value['after']:.4g}", unit])
    columns = ["parameter", "before", "after", "unit"]
    return TextTable(f"Declared parameters: {name}", columns, rows)


def _over_variable(answer: Answer, finding: Finding, kept: Kept) -> list[tuple[str, Markup]]:
    """Draw the residual of the test runs over the finding's own variable."""
    refit = answer.refits.of[finding.balance]
    before, after = answer.refits.before(finding.balance), answer.refits.after(finding.balance)
    found = _channel(kept)
    if found is None:
        return []
    variable, channel = found
    x: list[FloatArray] = []
    old: list[FloatArray] = []
    new: list[FloatArray] = []
    for name in refit.test_names:
        values = refit.channel(after, name, channel)
        left, right = (refit.residuals(solved, name) for solved in (before, after))
        if values is None or left is None or right is None:
            return []
        x.append(values)
        old.append(left[1] - left[1].mean())
        new.append(right[1] - right[1].mean())
    whole = np.concatenate(x)
    if channel == "motor_angle_rad":
        whole = np.mod(whole, 2 * np.pi)
    scale, unit = display(answer.diagnosis.unit[finding.balance])
    label = f"{variable.replace('_', ' ')}, {unit_of(channel)}"
    panels = [
        figures.Panel(f"{label}: {when}", whole, scale * np.concatenate(values))
        for when, values in (("before", old), ("after", new))
    ]
    caption = (
        f"{finding.balance}: the residual of the test runs before and after, mean and the middle"
        " 90 % of the samples."
    )
    return [(caption, figures.against(panels, f"residual, {unit}", caption, bins=48))]


def _channel(kept: Kept) -> tuple[str, str] | None:
    """Return the variable that a cause is drawn over, and its channel."""
    cause = kept.scored.candidate.cause
    if isinstance(cause, Function):
        role = next((v for v in cause.variables if v in cause.place.roles), None)
        return None if role is None else (role, cause.place.roles[role][0])
    for role, channel in cause.channels:
        if role in VARIABLE_OF_ROLE:
            return VARIABLE_OF_ROLE[role], channel
    return None


def _by_run(diagnosis: Diagnosis, name: str) -> tuple[str, Markup]:
    error = diagnosis.errors[name]
    scale, unit = display(diagnosis.unit[name])
    pairs = {
        run: (scale * before, scale * error.by_run_after[run])
        for run, before in error.by_run_before.items()
    }
    caption = f"{name}: error of each test run before and after."
    return caption, figures.paired_bars(pairs, ("before", "after"), f"rmse, {unit}", caption)
