"""A diagnosis as one interactive page: the answer and what to check, the evidence, the method."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from estimation.causes.verdict import Answer
from estimation.diagnosis.result import Diagnosis, Finding, Value
from estimation.files import write_text_atomic
from estimation.model import parameter_keys
from rig.diagnosis.traces import Traces, traces
from rig.output.charts import render
from rig.output.provenance import Provenance
from rig.output.table import TextTable
from rig.reports import diagnosis_words as words
from rig.reports.diagnosis_figures import charts

VERDICTS = {
    "identified": "effect identified",
    "one_of": "one of several effects",
    "depends_on": "effect of unknown form",
    "something_missing": "model incomplete, cause not identified",
    "unexplained": "no effect identified; noise does not explain the error",
    "nothing_missing": "no unmodelled effect found",
}
"""Verdict to the words of the heading."""


CONFIDENCE = (
    "Confidence is the posterior probability of the name among all candidates. How often it was"
    " right on drawn campaigns is in docs/results/diagnosis-numbers.md; answers that were sure and"
    " wrong are counted in docs/results/diagnosis-versions.md."
)


def page(diagnosis: Diagnosis, signals: Traces, provenance: Provenance) -> str:
    """Return the page of HTML, which needs nothing outside itself.

    An equation without signals has no signal charts.
    """
    drawn = charts(diagnosis, signals)
    sealed = diagnosis.sealed
    doubts, limits = words.said_of_recordings(diagnosis)
    method = (
        f"The model was fitted and searched on {len(sealed.discover)} training runs. The"
        f" {len(sealed.confirm)} held-out test runs ({', '.join(sealed.confirm)}) were opened once,"
        f" at the end; seed {sealed.seed} chose them before any fit. Split {sealed.seal[:12]}, data"
        f" {sealed.data_hash[:12]}. It took {diagnosis.seconds:.0f} s."
    )
    return render(
        "diagnosis.html",
        {
            "title": f"Diagnosis: {VERDICTS[diagnosis.verdict]}",
            "sentences": [*doubts, *words.sentences(diagnosis)],
            "cards": [card(finding, diagnosis) for finding in diagnosis.findings],
            "errors": error_table(diagnosis),
            "charts": drawn,
            "runs": sealed.confirm,
            "tables": [
                _probabilities(diagnosis.findings),
                parameter_table(diagnosis.findings),
                *_moved(diagnosis, signals),
            ],
            "others": words.other_sentences(diagnosis),
            "limits": [*limits, CONFIDENCE],
            "next_experiment": words.next_sentence(diagnosis),
            "method": method,
            "provenance": provenance,
        },
    )


def page_of(done: Answer, seed: int) -> str:
    """Return the page of a diagnosis that this process made now."""
    return page(done.diagnosis, traces(done), Provenance.now(seed))


def json_of(done: Answer) -> str:
    """Return a diagnosis as the text of its JSON file."""
    return json.dumps(done.diagnosis.to_json(), indent=2, allow_nan=False) + "\n"


def write(
    done: Answer, seed: int, page_file: Path | None, json_file: Path | None = None
) -> list[str]:
    """Write the page and the JSON of a diagnosis where asked for; return a line for each file.

    Raises:
        OSError: A file cannot be written.
    """
    said = []
    if page_file is not None:
        write_text_atomic(page_file, page_of(done, seed))
        said.append(f"Report: {page_file}")
    if json_file is not None:
        write_text_atomic(json_file, json_of(done))
        said.append(f"Diagnosis: {json_file}")
    return said


def card(finding: Finding, diagnosis: Diagnosis) -> dict[str, Any]:
    """Return a finding as the person at the bench needs it.

    What it is in plain words, the verdict, name and text of each fact (size, error, confidence,
    alternatives), what to check at the rig, and the command that describes the effect, empty
    without a name.
    """
    scale, unit = words.display(diagnosis.unit[finding.error_of], finding.rmse_before)
    named = finding.verdict in ("identified", "one_of")
    variables = words.variables_of(finding)
    facts = []
    if named and finding.parameters:
        sizes = ", ".join(
            f"{name} {text}".strip() for name, text in words.sizes_of(finding).items()
        )
        facts.append(("Size", sizes))
    after = words.in_unit(scale * finding.rmse_after, unit)
    fall = f"{scale * finding.rmse_before:.3g} to {after}"
    runs = f"lower in {finding.runs_improved} of {finding.runs_total} held-out test runs"
    which = words.of_which(finding) + words.MEANS * finding.with_means
    facts.append((f"Error{which}", f"{fall}, {runs}"))
    if variables:
        facts.append(("Depends on", variables))
    facts.append(("Equation", " and ".join([finding.balance, *finding.also_in])))
    if finding.place not in ("", finding.balance):
        facts.append(("Place", finding.place))
    whole = len(diagnosis.sealed.discover) + len(diagnosis.sealed.confirm)
    if 0 < len(finding.runs_affected) < whole:
        facts.append(("Acts in", f"{len(finding.runs_affected)} of {whole} runs"))
    if finding.confidence is not None:
        facts.append(("Confidence", words.confidence(finding.confidence)))
    if finding.alternatives:
        alternatives = "; ".join(
            f"{words.meaning(a) or a} [{words.placed(finding, a)}]" for a in finding.alternatives
        )
        facts.append(("Could also be", alternatives))
    title = words.meaning_of(finding) if named else f"something that depends on {variables}"
    if not named and not variables:
        title = VERDICTS[finding.verdict]
    title = title or finding.family
    return {
        "title": title[0].upper() + title[1:],
        "verdict": VERDICTS[finding.verdict],
        "facts": facts,
        "check": words.check_of(finding),
        "command": f"rig effects {finding.form or finding.family}" if named else "",
    }


def error_table(diagnosis: Diagnosis) -> TextTable:
    """Return the errors on the held-out test runs before and after."""
    rows = []
    for name, error in diagnosis.errors.items():
        scale, unit = words.display(diagnosis.unit[name], error.with_means_before)
        low, high = error.ratio_ci95
        ratio = f"{error.after / error.before:.2f}" if error.before else ""
        if math.isfinite(low) and math.isfinite(high):
            ratio += f" ({low:.2f} to {high:.2f})"
        floor = diagnosis.noise_floor.get(name)
        values = (error.before, error.after, error.with_means_before, error.with_means_after)
        errors = (f"{scale * value:.3g}" for value in values)
        noise = "" if floor is None else f"{scale * floor:.3g}"
        rows.append([f"{name}, {unit}", *errors, ratio, noise])
    columns = ["equation", "before", "after", "before, with means", "after, with means"]
    return TextTable(
        "Error on the held-out test runs",
        [*columns, "after/before (95 %)", "noise floor"],
        rows,
        "Root mean square over the samples that the equation counts, those in motion where it"
        " declares friction; each run's mean removed, then with the means left in."
        " Interval: bootstrap over runs.",
    )


def parameter_table(findings: Sequence[Finding]) -> TextTable | None:
    """Return the parameters of the findings with their intervals; None where there are none."""
    rows = [
        [
            f"{finding.balance}, {finding.family},"
            f" {words.label(finding.form or finding.family, name)}",
            *_with_interval(known),
        ]
        for finding in findings
        for name, known in words.with_period(finding).items()
    ]
    if not rows:
        return None
    columns = ["parameter", "value", "95 %", "unit"]
    return TextTable("Parameters of the findings", columns, rows, "Bootstrap over runs.")


def _with_interval(known: Value) -> list[str]:
    """Return value, interval and unit, to the digits that the interval supports."""
    scale, unit = words.display(known.unit, known.value)
    if known.ci95 is None or not known.ci95[1] > known.ci95[0]:
        return [f"{scale * known.value:.4g}", "", unit]
    low, high = (scale * end for end in known.ci95)
    places = max(0, 1 - math.floor(math.log10(high - low)))
    return [f"{scale * known.value:.{places}f}", f"{low:.{places}f} to {high:.{places}f}", unit]


def _probabilities(findings: Sequence[Finding]) -> TextTable | None:
    rows = [
        [f"{finding.balance}: {words.meaning(family) or family} [{family}]", f"{100 * share:.1f} %"]
        for finding in findings
        for family, share in finding.probabilities.items()
    ]
    if not rows:
        return None
    rows += [
        [f"{finding.balance}: no effect, not {finding.family}", f"{100 * finding.no_effect:.1f} %"]
        for finding in findings
        if finding.no_effect
    ]
    note = "Among all candidates, the other findings being part of the model."
    return TextTable("Probability of each name", ["effect", "probability"], rows, note)


def _moved(diagnosis: Diagnosis, signals: Traces) -> list[TextTable]:
    """Return the declared parameters of each equation before and after the findings."""
    shown = []
    for name, parameters in diagnosis.moved.items():
        known = [signals.equations[name].model] if name in signals.equations else []
        units = {
            key: term.unit(parameter, model.target)
            for model in known
            for term, parameter, key in parameter_keys(model)
        }
        rows = []
        for key, value in parameters.items():
            scale, unit = words.display(units.get(key, ""), value["before"])
            cells = (f"{scale * value[side]:.4g}" for side in ("before", "after"))
            rows.append([key, *cells, unit])
        if rows:
            columns = ["parameter", "before", "after", "unit"]
            shown.append(TextTable(f"Declared parameters: {name}", columns, rows))
    return shown
