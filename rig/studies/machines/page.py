"""The page of the study of other people's machines."""

from rig.output.page import Page
from rig.output.table import TextTable
from rig.studies.machines.cases import CASES
from rig.studies.machines.study import MachineStudy

TITLE = "Machines that other people built"

NOTE = (
    "Errors are root mean squares over the samples of held-out runs, % of that of the target there."
    " The declared model is that of the machine's file; effects are those that the diagnosis found"
    " on the other runs. The held-out runs were opened once."
)


def page(study: MachineStudy) -> Page:
    """Return the study's page."""
    found = [row for row in study.rows if row.found_percent < row.declared_percent]
    lead = (
        f"{len(study.rows)} equations of {len({row.case for row in study.rows})} machines;"
        f" effects were found in {len(found)}."
    )
    cards = sorted({case.card for case in CASES})
    linked = "Cards: " + ", ".join(f"[{card}](../machines/{card}.md)" for card in cards) + "."
    skipped = ["Not studied: " + " ".join(study.skipped)] if study.skipped else []
    return Page(TITLE, [lead, *skipped, linked], _tables(study), study.provenance)


def _tables(study: MachineStudy) -> list[TextTable]:
    """Return the published estimates made again, errors, and findings."""
    errors = [
        [
            f"{row.case}, {row.equation}",
            row.published,
            f"{row.declared_percent:.2f}",
            f"{row.found_percent:.2f}",
            f"{row.runs[0]} + {row.runs[1]}",
        ]
        for row in study.rows
    ]
    heads = ("machine, equation", "published", "declared %", "with effects %", "runs + held out")
    found = [
        [f"{row.case}, {row.equation}", " ".join(row.findings), " ".join(row.checks) or "none"]
        for row in study.rows
    ]
    made = [TextTable("Errors on held-out runs", heads, errors, NOTE)]
    if study.reproduced:
        again = [
            [
                name,
                ", ".join(f"{key} {value:.4f}" for key, value in one.parameters.items()),
                f"{one.percent:.3f}",
            ]
            for name, one in study.reproduced
        ]
        made.insert(
            0,
            TextTable(
                "EMPS: the authors' estimates made again",
                ("model", "parameters", "relative error %"),
                again,
                "Published: 95.1089 kg, 203.5034 N s/m, 20.3935 N, -3.1648 N, 4.083 %; by direction"
                " 166.7 and 240.4 N s/m, 3.112 %.",
            ),
        )
    made.append(TextTable("Findings", ("machine, equation", "finding", "to check"), found))
    return made
