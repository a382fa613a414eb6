"""Screening of a campaign: a declared model's fit, and the largest structure of its residual."""

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from estimation.campaign import Campaign
from estimation.cross_validation import HeldOutError
from estimation.model import Estimate, Model, balance_channels, estimate
from estimation.residual import RunResidual, Structure, profile, residuals
from rig.output import figures
from rig.output.provenance import Provenance
from rig.output.render import render
from rig.output.table import TextTable, counted
from rig.reports.diagnosis_words import display

LIMITS = (
    "Screening only: smooth functions of one variable at a time, fitted on the other runs, each"
    " run's mean or the mean of all removed. Variables that move together share what they explain."
    " A share means that something depends on the variable, or on one that moves with it; it"
    " identifies no effect."
)


def first_look(
    model: Model,
    campaign: Campaign,
    structures: Sequence[Structure],
    story: str,
    provenance: Provenance,
) -> str:
    """Return the page.

    Args:
        model: A fitted model.
        campaign: The runs it was fitted on.
        structures: From `estimation.residual.largest_structure`, largest first.
        story: Description of the run, in a sentence or two.
        provenance: When and from what this was made.
    """
    parts = residuals(model, campaign)
    return render(
        "first_look.html",
        {
            "title": f"Screening: {model.name} model",
            "lead": structures[0].sentence(),
            "story": story,
            "figures": _figures(model, campaign, structures, parts),
            "tables": [parameter_table(model), structure_table(structures)],
            "limits": LIMITS,
            "provenance": provenance,
        },
    )


def parameter_table(model: Model) -> TextTable:
    """Return a fitted model's parameters."""
    rows = []
    for term in model.terms:
        for parameter in term.parameters:
            known = term.values[parameter.name]
            unit = term.unit(parameter, model.target)
            side = "+" if term.sign == 1 else "-"
            name = f"{term.effect.id}, {parameter.name}"
            rows.append([name, side, f"{known.value:.4g}", _spread(known), unit])
    evidence = model.evidence
    note = ""
    if evidence is not None:
        scale, unit = display(model.unit)
        note = (
            f"Fitted on {counted(len(evidence.runs), 'run')}, {evidence.samples:,} samples. RMSE"
            f" {scale * evidence.rmse:.3g} {unit} with each run's mean removed,"
            f" {scale * evidence.rmse_with_means:.3g} {unit} with means. Spread: standard deviation"
            " over a bootstrap of runs; empty at a bound or with one run."
        )
    return TextTable("Fitted model", ["parameter", "side", "value", "spread", "unit"], rows, note)


def held_out_sentence(model: Model, error: HeldOutError) -> str:
    """Return the error on runs not fitted on in words."""
    scale, unit = display(model.unit)
    return (
        f"{model.target} on {error.runs} runs not fitted on: RMSE {scale * error.rmse:.3g} {unit}"
        f" with each run's mean removed, {scale * error.rmse_with_means:.3g} {unit} with means."
    )


def _spread(known: Estimate) -> str:
    return "" if known.spread is None else f"{known.spread:.2g}"


def structure_table(structures: Sequence[Structure]) -> TextTable:
    """Return the ranked structures of a residual."""
    scale, unit = display(structures[0].unit)
    rows = [
        [
            s.variable.replace("_", " "),
            f"{100 * s.explained_fraction:.1f} %",
            f"{100 * s.chance_fraction:.1f} %",
            f"{scale * s.amplitude:.2g} {unit}",
            s.detail,
        ]
        for s in structures
    ]
    columns = ["variable", "explained on runs held out", "chance", "amplitude", "where"]
    return TextTable("What the residual goes with", columns, rows)


def _figures(
    model: Model,
    campaign: Campaign,
    structures: Sequence[Structure],
    parts: Sequence[RunResidual],
) -> list[tuple[str, Markup]]:
    scale, unit = display(model.unit)
    drawn = []
    ordered = sorted(parts, key=lambda part: float(np.std(part.values)))
    name = ordered[len(ordered) // 2].run.name
    (handle,) = campaign.select([name]).runs
    run = balance_channels(model, handle.recording())
    caption = f"Run {name}, the run of median error: sensor and estimate."
    series = {"sensor": scale * run[model.target], "estimate": scale * estimate(model, run)}
    label = f"{model.target.rsplit('_n_m', 1)[0].replace('_', ' ')}, {unit}"
    drawn.append((caption, figures.over_time(run.time_s, series, label, caption)))
    found = profile(model, parts, structures[0].variable)
    caption = (
        f"The residual over {structures[0].variable.replace('_', ' ')}: mean and the middle 90 %"
        " of the samples."
    )
    panel = figures.Panel(found.label, found.x, scale * found.residual)
    drawn.append((caption, figures.against([panel], f"residual, {unit}", caption, bins=48)))
    shares = {s.variable: 100 * s.explained_fraction for s in structures}
    chance = ("chance", 100 * structures[0].chance_fraction)
    caption = "Share of the residual's variance that goes with each variable, on runs held out."
    drawn.append((caption, figures.bars(shares, "explained, %", caption, chance)))
    return drawn
