"""A fitted model's parameters as a table, and its error on held-out runs in a sentence."""

import math

from estimation.cross_validation import HeldOutError
from estimation.effects import Parameter
from estimation.model import Estimate, Model, parameter_keys
from rig.output.table import TextTable, counted
from rig.reports.diagnosis_words import display, in_unit, label, plain_unit


def parameter_table(model: Model) -> TextTable:
    """Return a fitted model's parameters."""
    rows, evidence = [], model.evidence
    for term, parameter, key in parameter_keys(model):
        known = term.values[parameter.name]
        unit = plain_unit(term.unit(parameter, model.target))
        sign = "+" if term.sign == 1 else "-"
        effect = key.removesuffix(f".{parameter.name}")
        name = f"{effect}, {label(term.effect.id, parameter.name)}"
        interval = _interval(known, parameter, len(evidence.runs) if evidence else 0)
        rows.append([name, sign, f"{known.value:.4g}", interval, unit])
    note = ""
    if evidence is not None:
        scale, unit = display(model.unit, evidence.rmse_with_means)
        note = (
            f"Fitted on {counted(len(evidence.runs), 'run')}, {evidence.samples:,} samples. RMSE"
            f" {in_unit(scale * evidence.rmse, unit)} with each run's mean removed,"
            f" {in_unit(scale * evidence.rmse_with_means, unit)} with means. Sign: + adds to the"
            " target, - subtracts from it. 95 %: interval of a bootstrap over runs, wider by"
            " what noise of the readings has moved; empty with one run, 'none' at a bound or where"
            " some of the runs do not identify it, and 'any' where the runs allow every value"
            " within the bounds."
        )
    return TextTable("Fitted model", ["parameter", "sign", "value", "95 %", "unit"], rows, note)


def _interval(known: Estimate, parameter: Parameter, runs: int) -> str:
    if known.ci95 is None:
        return "none" if runs > 1 and not parameter.is_count else ""
    bounds = (parameter.lower, parameter.upper)
    if all(math.isclose(*ends, rel_tol=0.01) for ends in zip(known.ci95, bounds, strict=True)):
        return "any"
    return "{:.4g} to {:.4g}".format(*known.ci95)


def held_out_sentence(model: Model, error: HeldOutError) -> str:
    """Return the error on runs not fitted on in words."""
    scale, unit = display(model.unit, error.rmse_with_means)
    return (
        f"{model.target} on {error.runs} runs not fitted on: RMSE"
        f" {in_unit(scale * error.rmse, unit)} with each run's mean removed,"
        f" {in_unit(scale * error.rmse_with_means, unit)} with means."
    )
