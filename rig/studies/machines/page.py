"""The page of the study of other people's machines."""

from rig.output.page import Page
from rig.output.table import TextTable
from rig.studies.machines.study import CASES, MachineStudy

TITLE = "Machines that other people built"

NOTE = (
    "Errors are root mean squares over the samples of held-out runs, % of that of the target there."
    " The declared model is that of the machine's file; effects are those that the diagnosis found"
    " on the other runs. The held-out runs were opened once."
)


def page(study: MachineStudy) -> Page:
    """Return the study's page: the published estimates made again, errors, and findings."""
    better = sum(row.found_percent < row.declared_percent for row in study.rows)
    lead = (
        f"{len(study.rows)} equations of {len({row.case for row in study.rows})} machines;"
        f" effects were found in {better}."
    )
    cards = sorted({case.folder for case in CASES})
    linked = "Cards: " + ", ".join(f"[{card}](../machines/{card}.md)" for card in cards) + "."
    skipped = ["Not studied: " + " ".join(study.skipped)] if study.skipped else []
    errors, found = [], []
    for row in study.rows:
        name = f"{row.case}, {row.equation}"
        percents = (f"{value:.2f}" for value in (row.declared_percent, row.found_percent))
        errors.append([name, row.published, *percents, f"{row.runs[0]} + {row.runs[1]}"])
        found.append([name, " ".join(row.findings), " ".join(row.checks) or "none"])
    heads = ("machine, equation", "published", "declared %", "with effects %", "runs + held out")
    tables = [
        *([_reproduced(study)] if study.reproduced else []),
        TextTable("Errors on held-out runs", heads, errors, NOTE),
        TextTable("Findings", ("machine, equation", "finding", "to check"), found),
    ]
    return Page(TITLE, [lead, *skipped, linked], tables, study.provenance)


def _reproduced(study: MachineStudy) -> TextTable:
    rows = []
    for name, one in study.reproduced:
        values = ", ".join(f"{key} {value:.4f}" for key, value in one.parameters.items())
        rows.append([name, values, f"{one.percent:.3f}"])
    return TextTable(
        "EMPS: the authors' estimates made again",
        ("model", "parameters", "relative error %"),
        rows,
        "Published: 95.1089 kg, 203.5034 N s/m, 20.3935 N, -3.1648 N, 4.083 %; by direction 166.7"
        " and 240.4 N s/m, 3.112 %.",
    )
