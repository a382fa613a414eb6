"""A fitted model's parameters as a table, and its error on held-out runs in a sentence."""

from estimation.cross_validation import HeldOutError
from estimation.model import Model
from rig.output.table import TextTable, counted
from rig.reports.diagnosis_words import display, in_unit


def parameter_table(model: Model) -> TextTable:
    """Return a fitted model's parameters."""
    rows = []
    for term in model.terms:
        for parameter in term.parameters:
            known = term.values[parameter.name]
            unit = term.unit(parameter, model.target)
            side = "+" if term.sign == 1 else "-"
            name = f"{term.effect.id}, {parameter.name}"
            spread = "" if known.spread is None else f"{known.spread:.2g}"
            rows.append([name, side, f"{known.value:.4g}", spread, unit])
    evidence = model.evidence
    note = ""
    if evidence is not None:
        scale, unit = display(model.unit, evidence.rmse_with_means)
        note = (
            f"Fitted on {counted(len(evidence.runs), 'run')}, {evidence.samples:,} samples. RMSE"
            f" {in_unit(scale * evidence.rmse, unit)} with each run's mean removed,"
            f" {in_unit(scale * evidence.rmse_with_means, unit)} with means. Spread: standard"
            " deviation over a bootstrap of runs; empty at a bound or with one run."
        )
    return TextTable("Fitted model", ["parameter", "side", "value", "spread", "unit"], rows, note)


def held_out_sentence(model: Model, error: HeldOutError) -> str:
    """Return the error on runs not fitted on in words."""
    scale, unit = display(model.unit, error.rmse_with_means)
    return (
        f"{model.target} on {error.runs} runs not fitted on: RMSE"
        f" {in_unit(scale * error.rmse, unit)} with each run's mean removed,"
        f" {in_unit(scale * error.rmse_with_means, unit)} with means."
    )
