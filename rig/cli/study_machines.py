"""`rig study machines`: other people's machines, diagnosed from their published recordings."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import SeedOption, TablesFile
from rig.output.console import JsonFlag, emit_json, progress, show_result

machine_studies = typer.Typer(rich_markup_mode=None)


@machine_studies.command()
def machines(
    data: Annotated[
        Path,
        typer.Argument(
            metavar="DATA_FOLDER",
            help="Folder with emps, smart-grasper, sts3215 and ur10e, as folders or as"
            " machine-NAME.tar.xz; what is not there is left out.",
        ),
    ],
    out: TablesFile = None,
    seed: SeedOption = 0,
    json: JsonFlag = False,
) -> None:
    """Diagnose machines that other people built, and compare with what they published."""
    from rig.errors import UsageError
    from rig.studies.machines import page
    from rig.studies.machines.study import run_study

    if not data.is_dir():
        raise UsageError(f"There is no folder {data}.", fix="Name the folder of the recordings.")
    with progress() as bar:
        task = bar.add_task("machines", total=None)
        study = run_study(data, seed, on_stage=lambda what: bar.update(task, description=what))
    if not study.rows:
        raise UsageError(
            f"No machine's recordings are in {data}.",
            " ".join(study.skipped),
            "Put emps, smart-grasper, sts3215 or ur10e there.",
        )
    lines = [page.lead(study), *study.skipped]
    show_result(lines, page.tables(study), out, lambda: page.markdown(study), json)
    if json:
        emit_json(study)
