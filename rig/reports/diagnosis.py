"""A diagnosis on one page: the sentence, the plots, the numbers, and what it cannot tell."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup

from estimation.channels import unit_of
from estimation.diagnosis.design import Run
from estimation.diagnosis.frozen import Frozen
from estimation.diagnosis.result import Diagnosis, Finding, Value
from estimation.diagnosis.story import Story
from estimation.diagnosis.variables import channels_of
from estimation.recording import FloatArray
from rig.diagnosis.run import Diagnosed
from rig.output import figures
from rig.output.provenance import Provenance
from rig.output.render import render
from rig.output.table import TextTable
from rig.reports.diagnosis_words import display, next_sentence, other_sentences, sentences

CONFIDENCE = (
    "Confidence is the share of run bootstraps in which the name wins, times the chances that its"
    " gain is real and general; on known cases it was too sure:"
    " docs/results/diagnosis-versions.md."
)

FUNCTIONS = (
    "bump(x; c, s) = exp(-((x - c) / s)^2), step(x; c, s) = (1 + tanh((x - c) / s)) / 2,"
    " play(x; s): how far a slack of s on either side is crossed, -1 to 1."
)


def page(done: Diagnosed, provenance: Provenance) -> str:
    """Return the page of HTML."""
    diagnosis = done.diagnosis
    sealed = done.sealed
    story = (
        f"{len(sealed.discover)} runs discovered, {len(sealed.confirm)} confirmed"
        f" ({', '.join(sealed.confirm)}); chosen by seed {sealed.seed} before any fit, seal"
        f" {sealed.seal[:12]}, data {sealed.data_hash[:12]}. It took {diagnosis.seconds:.0f} s."
    )
    drawn: list[tuple[str, Markup]] = []
    for finding in diagnosis.findings:
        drawn += _over_variable(done.stories[finding.balance], finding)
    for name in done.stories:
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
    if any(f.form for f in done.diagnosis.findings):
        shown.append(_forms(done.stories))
    if any(f.formulas for f in done.diagnosis.findings):
        shown.append(_formulas(done.diagnosis))
    for name, story in done.stories.items():
        shown += [_tried(done.diagnosis, name, story), _moved(done.diagnosis, name, story)]
    return shown


def _errors(diagnosis: Diagnosis) -> TextTable:
    rows = []
    for name, error in diagnosis.errors.items():
        scale, unit = display(diagnosis.unit[name])
        low, high = error.ratio_ci95
        values = (error.before, error.after, error.with_means_before, error.with_means_after)
        rows.append([name, *(f"{scale * v:.3g}" for v in values), f"{low:.2f} to {high:.2f}", unit])
    columns = ["balance", "before", "after", "with means, before", "after", "after/before", "unit"]
    return TextTable(
        "Error on the confirm runs",
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
    """Return value, interval and unit, with the digits that the interval leaves."""
    scale, unit = display(known.unit)
    if known.ci95 is None or not known.ci95[1] > known.ci95[0]:
        return [f"{scale * known.value:.4g}", "", unit]
    low, high = (scale * end for end in known.ci95)
    places = max(0, 1 - math.floor(math.log10(high - low)))
    return [f"{scale * known.value:.{places}f}", f"{low:.{places}f} to {high:.{places}f}", unit]


def _forms(stories: Mapping[str, Story]) -> TextTable:
    """Return the terms beside each named effect, for what its equation leaves."""
    rows = []
    for name, story in stories.items():
        for claim in story.claims:
            if claim.form is None:
                continue
            for term, words in zip(claim.form.terms, claim.form.products, strict=True):
                own = story.values[story.after.terms.index(term)]
                unit = term.term.unit(term.effect.amplitudes[0], story.balance.model.target)
                known = Value(own["amplitude"].value, unit, own["amplitude"].ci95)
                rows.append([f"{name}, {claim.family}: times {words}", *_with_interval(known)])
    columns = ["term, angles in rad", "value", "95 %", "unit"]
    return TextTable(
        "Beside the equation of what was found",
        columns,
        rows,
        "An equation of the catalogue is one form of a cause, and a rig's own is a little another."
        " These terms of the same variables tell what the equation leaves; they are no second"
        f" cause. A model file holds them as unknown.*. {FUNCTIONS}",
    )


def _formulas(diagnosis: Diagnosis) -> TextTable:
    rows = []
    for finding in diagnosis.findings:
        scale, unit = display(diagnosis.unit[finding.balance])
        for one in finding.formulas:
            left = "" if one.rmse_after is None else f"{scale * one.rmse_after:.3g} {unit}"
            rows.append([f"{finding.balance}: {one.text}", f"{100 * one.gain:.1f} %", left])
    return TextTable(
        "Formulas of what has no name",
        ["formula, SI units", "gain, runs left out", "error on the confirm runs"],
        rows,
        "These do about equally well on the runs that discovered; a model file holds the first."
        f" {FUNCTIONS}",
    )


def _tried(diagnosis: Diagnosis, name: str, story: Story) -> TextTable:
    rows = []
    claimed = {f.family for f in diagnosis.findings if name in (f.balance, *f.also_in)}
    for k, step in enumerate(story.discovery.steps, start=1):
        twin = "" if step.p_twin is None else f"{step.p_twin:.3f}"
        cells = [f"{100 * step.gain:.1f} %", f"{step.p:.3f}", twin, f"{step.agree:.3f}"]
        said = "claimed" if step.family in claimed else "not claimed"
        rows.append([f"step {k}: {step.family}, {said}", *cells])
    for trial in story.discovery.ranking[1:6]:
        cells = [f"{100 * trial.gain:.1f} %", f"{trial.p:.3f}", "", f"{trial.agree:.3f}"]
        rows.append([f"at first also: {trial.family}", *cells])
    left = story.discovery.left_map
    if left is not None:
        cells = [f"{100 * left.gain:.1f} %", f"{left.p:.3f}", "", f"{left.agree:.3f}"]
        rows.append([f"map of {' and '.join(left.variables)}", *cells])
    return TextTable(
        f"What was tried: {name}",
        ["effect", "gain, runs left out", "p, surrogates", "p, twins", "p, runs"],
        rows,
        f"{len(story.families)} families at {story.candidates} grid points, then maps of one and"
        " two variables. Gain: share of the squared error left at that step.",
    )


def _moved(diagnosis: Diagnosis, name: str, story: Story) -> TextTable:
    model = story.balance.model
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


def _over_variable(story: Story, finding: Finding) -> list[tuple[str, Markup]]:
    """Draw the residual of the confirm runs over the finding's own variable."""
    channels = channels_of(finding.balance, story.confirm[0].channels)
    variable = next((v for v in finding.depends_on if v in channels), None)
    if variable is None:
        return []
    channel = channels[variable]
    if any(channel not in run.channels for run in story.confirm):
        return []
    x = np.concatenate([run.channels[channel][run.used] for run in story.confirm])
    if channel == "motor_angle_rad":
        x = np.mod(x, 2 * np.pi)
    scale, unit = display(story.balance.model.unit)
    label = f"{variable.replace('_', ' ')}, {unit_of(channel)}"
    panels = [
        figures.Panel(f"{label}: {when}", x, scale * _left(model, story.confirm))
        for when, model in (("before", story.before), ("after", story.after))
    ]
    caption = (
        f"{finding.balance}: the residual of the confirm runs before and after, mean and the middle"
        " 90 % of the samples."
    )
    return [(caption, figures.against(panels, f"residual, {unit}", caption, bins=48))]


def _left(model: Frozen, runs: Sequence[Run]) -> FloatArray:
    errors = [model.error(run) for run in runs]
    return np.concatenate([e - e.mean() for e in errors])


def _by_run(diagnosis: Diagnosis, name: str) -> tuple[str, Markup]:
    error = diagnosis.errors[name]
    scale, unit = display(diagnosis.unit[name])
    pairs = {
        run: (scale * before, scale * error.by_run_after[run])
        for run, before in error.by_run_before.items()
    }
    caption = f"{name}: error of each confirm run before and after."
    return caption, figures.paired_bars(pairs, ("before", "after"), f"rmse, {unit}", caption)
