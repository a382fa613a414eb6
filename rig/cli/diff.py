"""`rig diff`: what changed between two campaigns of one machine?"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.left_out import say_left_out
from rig.cli.options import EquationOption, FormatOption, MachineOption, ModelOption, SeedOption
from rig.output.console import JsonFlag, emit_json, results

if TYPE_CHECKING:
    from estimation.changes.difference import Difference


def diff(
    a: Annotated[Path, typer.Argument(help="Recordings of the first campaign.")],
    b: Annotated[Path, typer.Argument(help="Recordings of the second campaign.")],
    model: ModelOption = None,
    machine: MachineOption = None,
    balance: EquationOption = None,
    on: Annotated[
        Path | None, typer.Option(help="Recordings of a third campaign, to predict.")
    ] = None,
    seed: SeedOption = 0,
    format_: FormatOption = None,
    json_: JsonFlag = False,
) -> None:
    """Find what changed between two campaigns of one machine, with intervals over runs.

    Two dates, two instruments, before and after a repair: which declared parameters moved, which
    effects came or went. A change is stated where it predicts runs left out better than none does.
    """
    from estimation.changes.compare import compare
    from rig.diagnosis.subject import subject
    from rig.output.console import progress
    from rig.output.table import to_rich
    from rig.reports.changes import change_table, lines, prediction_table

    first = subject(a, model, balance, format_, machine)
    second = subject(b, model, balance, format_, machine)
    third = () if on is None else subject(on, model, balance, format_, machine).campaign.evidence
    for path, campaign in ((a, first.campaign), (b, second.campaign)):
        say_left_out(path, campaign)
    with progress() as bar:
        task = bar.add_task("changes", total=1)
        both = first.campaign.evidence, second.campaign.evidence
        found: Difference = compare(*both, first.models, third, seed)
        bar.advance(task)
    screen = results(json_)
    for line in lines(found):
        screen.print(line)
    if found.changes:
        screen.print(to_rich(change_table(found)))
    if found.predicted:
        screen.print(to_rich(prediction_table(found)))
    if json_:
        emit_json(found)
