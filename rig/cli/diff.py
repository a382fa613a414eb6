"""`rig diff`: what changed between two campaigns of one machine?"""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from rig.cli.options import (
    EquationOption,
    FormatOption,
    MachineOption,
    ModelOption,
    SeedOption,
    say_left_out,
)
from rig.output.console import JsonFlag, present
from rig.output.table import TextTable


def diff(
    a: Annotated[Path, Argument(help="Recordings of the first campaign.")],
    b: Annotated[Path, Argument(help="Recordings of the second campaign.")],
    model: ModelOption = None,
    machine: MachineOption = None,
    balance: EquationOption = None,
    on: Annotated[Path | None, Option(help="Recordings of a third campaign, to predict.")] = None,
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
    from rig.reports.changes import change_table, lines, prediction_table

    first = subject(a, model, balance, format_, machine)
    second = subject(b, model, balance, format_, machine)
    third = () if on is None else subject(on, model, balance, format_, machine).campaign.evidence
    for path, campaign in ((a, first.campaign), (b, second.campaign)):
        say_left_out(path, campaign)
    with progress() as bar:
        task = bar.add_task("changes", total=1)
        both = first.campaign.evidence, second.campaign.evidence
        found = compare(*both, first.models, third, seed)
        bar.advance(task)
    shown: list[str | TextTable] = [*lines(found)]
    shown += [change_table(found)] if found.changes else []
    shown += [prediction_table(found)] if found.predicted else []
    present(json_, found, *shown)
