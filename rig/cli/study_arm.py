"""`rig study` on arms: a paper's results on joint torque, wrench, added mass, grasp."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.options import FiguresFolder, TablesFile, WorkersOption
from rig.output.console import JsonFlag, emit_json, progress, show_result

if TYPE_CHECKING:
    from rig.output.table import TextTable
    from rig.studies.seeds import Keeper

arm_studies = typer.Typer(rich_markup_mode=None)

StateFolder = Annotated[
    Path | None,
    typer.Option("--state", help="Folder of finished parts; a cache folder by default."),
]

Arms = Annotated[int, typer.Option(min=1, help="Simulated arms of each family, from seed 0.")]


def _from_page(drawn: list[Path], out: Path | None) -> list[str]:
    """Return the places of figures from where a page will be."""
    return [] if out is None else [os.path.relpath(path, out.parent) for path in drawn]


def _show(
    study: object,
    lines: Sequence[str],
    tables: "Sequence[TextTable]",
    page: Callable[[Sequence[str]], str],
    drawn: list[Path],
    out: Path | None,
    json: bool,
) -> None:
    """Print a study, write its page with the figures drawn, and print it as JSON if asked.

    Args:
        study: The study.
        lines: Lines printed before its tables.
        tables: Its tables.
        page: Makes its page, with figures at the places given.
        drawn: Figures that were drawn.
        out: File for the page.
        json: Whether it goes to stdout as JSON.
    """
    show_result(lines, tables, out, lambda: page(_from_page(drawn, out)), json)
    if json:
        emit_json(study)


@contextmanager
def resumable(
    state: Path | None, study: str, total: int, workers: int, what: str = "arms"
) -> Iterator["Keeper"]:
    """Show how much of a study is done; after an interruption, print how to resume.

    Yields:
        What keeps what the study has done.
    """
    from rig.studies.seeds import Keeper

    kept = state or Path.home() / ".cache" / "rig" / study
    try:
        with progress() as bar:
            task = bar.add_task(what, total=total)
            yield Keeper(kept, workers, lambda: bar.advance(task))
    except KeyboardInterrupt:
        sys.stderr.write(f"Finished parts are kept in {kept}: the same command resumes.\n")
        raise


@arm_studies.command()
def pique(
    data: Annotated[
        Path, typer.Option(help="Folder of measured arm motion, such as the dVRK paths.")
    ],
    paths: Annotated[
        tuple[str, str], typer.Option(help="Two runs: effects are chosen fitting the first.")
    ] = ("one18", "two18"),
    also: Annotated[
        list[str] | None,
        typer.Option(help="A further run to test on, with models fitted on the second path."),
    ] = None,
    out: TablesFile = None,
    figures: FiguresFolder = None,
    json: JsonFlag = False,
) -> None:
    """Make table 3.2 of Piqué 2018 again: an arm's joint torques in free space."""
    from rig.arm.search import open_paths
    from rig.studies.pique import page as shown
    from rig.studies.pique.study import run_study

    with progress() as bar:
        task = bar.add_task("paths", total=None)
        first, second, *others = open_paths(data, [*paths, *(also or [])])
        study = run_study(
            first, second, also=others, on_step=lambda step: bar.update(task, description=step)
        )
    drawn = shown.write_figures(figures, study) if figures is not None else []
    lines = [shown.lead(study), *shown.notes(study)]
    page = partial(shown.markdown, study)
    _show(study, lines, shown.tables(study), page, drawn, out, json)


@arm_studies.command()
def excitation(
    starts: Annotated[int, typer.Option(min=1, help="Random starts, from seed 0.")] = 5,
    evaluations: Annotated[
        int, typer.Option(min=100, help="Condition numbers each search may take of each start.")
    ] = 3000,
    trajectory: Annotated[
        Path | None, typer.Option(help="File for one period of the best one, as text at 200 Hz.")
    ] = None,
    out: TablesFile = None,
    json: JsonFlag = False,
) -> None:
    """Design an arm's excitation within its limits at every instant, compared with the thesis'."""
    from rig.arm.excitation import run_excitation, table, write_trajectory
    from rig.output.table import to_page

    with progress() as bar:
        task = bar.add_task("starts", total=starts)
        study, best = run_excitation(starts, evaluations, lambda: bar.advance(task))
    if trajectory is not None:
        write_trajectory(best, trajectory)

    def page() -> str:
        return to_page([f"Excitation of the {study.arm}"], [table(study)], study.provenance)

    show_result([], [table(study)], out, page, json)
    if json:
        emit_json(study)


@arm_studies.command()
def wrench(
    seeds: Arms = 2,
    workers: WorkersOption = 1,
    state: StateFolder = None,
    out: TablesFile = None,
    figures: FiguresFolder = None,
    json: JsonFlag = False,
) -> None:
    """Make tables 3.1 to 3.3 of Piqué 2018 again on simulated arms: free space and contact."""
    from rig.arm.hidden import FAMILIES
    from rig.studies.pique import wrench_page as shown
    from rig.studies.pique.wrench import run_wrench_study

    with resumable(state, "wrench", seeds * len(FAMILIES), workers) as keeper:
        study = run_wrench_study(seeds, keeper)
    drawn = shown.write_figures(figures, study) if figures is not None else []
    lines = [shown.lead(study), *shown.NOTES]
    page = partial(shown.markdown, study)
    _show(study, lines, shown.tables(study), page, drawn, out, json)


@arm_studies.command()
def delsol(
    seeds: Arms = 2,
    workers: WorkersOption = 1,
    state: StateFolder = None,
    out: TablesFile = None,
    figures: FiguresFolder = None,
    json: JsonFlag = False,
) -> None:
    """Make tables 1, 2 and 5 of del Sol et al. 2014 again on simulated hydraulic arms."""
    from rig.arm.hidden import FAMILIES
    from rig.studies.delsol import page as shown
    from rig.studies.delsol.study import run_delsol

    with resumable(state, "delsol", seeds * len(FAMILIES), workers) as keeper:
        study = run_delsol(seeds, keeper)
    drawn = shown.write_figures(figures, study) if figures is not None else []
    lines = [shown.lead(study), shown.NOTE]
    page = partial(shown.markdown, study)
    _show(study, lines, shown.tables(study), page, drawn, out, json)


@arm_studies.command()
def zhang(
    seeds: Arms = 2,
    workers: WorkersOption = 1,
    state: StateFolder = None,
    out: TablesFile = None,
    figures: FiguresFolder = None,
    json: JsonFlag = False,
) -> None:
    """Make Zhang et al. 2022 again on simulated arms: torque in free space, grasp and wrench."""
    from rig.arm.hidden import FAMILIES
    from rig.studies.zhang import page as shown
    from rig.studies.zhang.figures import write_figures
    from rig.studies.zhang.study import run_zhang

    with resumable(state, "zhang", seeds * len(FAMILIES), workers) as keeper:
        study = run_zhang(seeds, keeper)
    drawn = write_figures(figures, study) if figures is not None else []
    lines = [shown.lead(study), *shown.notes(study)]
    page = partial(shown.markdown, study)
    _show(study, lines, shown.tables(study), page, drawn, out, json)


@arm_studies.command()
def payload(
    data: Annotated[
        Path, typer.Option(help="Folder of measured arm motion, such as the dVRK paths.")
    ],
    on: Annotated[list[str], typer.Option(help="A run to look for an added mass on.")],
    model: Annotated[str, typer.Option(help="Run without the mass, to fit a model on.")] = "two18",
    height_m: Annotated[
        float, typer.Option(min=0.01, help="Height of the mass above the remote centre, m.")
    ] = 0.535,
    height_error_m: Annotated[
        float, typer.Option(min=0.0, help="Standard error of that height, m.")
    ] = 0.01,
    out: TablesFile = None,
    json: JsonFlag = False,
) -> None:
    """Find a mass added to an arm's insertion axis from its joints' torque."""
    from rig.arm.payload import find_payload, table
    from rig.arm.search import open_paths
    from rig.output.table import to_page

    with progress() as bar:
        task = bar.add_task("paths", total=None)
        fitted, *runs = open_paths(data, [model, *on])
        found = find_payload(
            fitted, runs, height_m, height_error_m, lambda name: bar.update(task, description=name)
        )

    def page() -> str:
        return to_page(["Masses added to an arm"], [table(found)], found.provenance)

    show_result([], [table(found)], out, page, json)
    if json:
        emit_json(found)
