"""`rig estimator`: what a file holds, and which of two is better."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.help import group
from rig.cli.options import FormatOption, TablesFile
from rig.output.console import JsonFlag, emit_json, progress, show_result

estimator_app = group("estimator", "Compare estimators.")


@estimator_app.callback()
def _estimator() -> None:
    """Compare estimators."""


@estimator_app.command()
def compare(
    first: Annotated[Path, typer.Argument(help="Estimator of rig fit or rig adapt.")],
    second: Annotated[Path, typer.Argument(help="Another one of the same channel.")],
    on: Annotated[Path, typer.Option("--on", help="Recordings: a file, folder or archive.")],
    format_: FormatOption = None,
    out: TablesFile = None,
    json: JsonFlag = False,
) -> None:
    """Compare two estimators on the same runs: which is better, and where."""
    from estimation.estimator import load
    from rig.importers.jaw_steps import sentence, with_one_zero
    from rig.importers.registry import open_campaign
    from rig.models.compared import compare as compared
    from rig.output.table import to_page
    from rig.reports import compared as shown

    files, estimators = (first, second), (load(first), load(second))
    campaign, steps = with_one_zero(open_campaign(on, format_), estimators[0].target)
    with progress() as bar:
        task = bar.add_task("runs", total=len(campaign))
        found = compared(files, estimators, campaign, lambda run: bar.advance(task))
    lines, tables = [*shown.lines(found), *sentence(steps)], shown.tables(found)

    def page() -> str:
        return to_page(["Two estimators on the same runs", *lines], tables, found.provenance)

    show_result(lines, tables, out, page, json)
    if json:
        emit_json(found)
