"""`rig study` on simulated and measured arms, and what all studies share: page and kept parts."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from rig.cli.options import FiguresFolder, TablesFile, WorkersOption, require_new
from rig.configuration.folders import cache_folder
from rig.output.console import JsonFlag, counted, counting, described

if TYPE_CHECKING:
    from rig.studies.seeds import Keeper

arm_studies = typer.Typer(rich_markup_mode=None)

StateFolder = Annotated[
    Path | None, Option("--state", help="Folder of finished parts; a cache folder by default.")
]

ArmData = Annotated[Path, Option(help="Folder of measured arm motion, such as the dVRK paths.")]


@contextmanager
def resumable(
    state: Path | None, study: str, total: int, workers: int, what: str = "arms"
) -> Iterator["Keeper"]:
    """Yield the keeper of a study's finished parts; when interrupted, print how to resume."""
    from rig.studies.seeds import Keeper

    kept = state or cache_folder() / study
    try:
        with counting(what, total) as advance:
            yield Keeper(kept, workers, advance)
    except KeyboardInterrupt:
        sys.stderr.write(f"Finished parts are kept in {kept}: the same command resumes.\n")
        raise


@arm_studies.command()
def pique(
    data: ArmData,
    paths: Annotated[
        tuple[str, str], Option(help="Two runs: effects are chosen fitting the first.")
    ] = ("one18", "two18"),
    also: Annotated[
        list[str] | None,
        Option(help="A further run to test on, with models fitted on the second path."),
    ] = None,
    out: TablesFile = None,
    figures: FiguresFolder = None,
    json: JsonFlag = False,
) -> None:
    """Make table 3.2 of Piqué 2018 again: an arm's joint torques in free space."""
    from rig.arm.search import open_paths
    from rig.studies.pique.page import page
    from rig.studies.pique.study import run_study

    with described("paths") as step:
        first, second, *others = open_paths(data, [*paths, *(also or [])])
        study = run_study(first, second, also=others, on_step=step)
    page(study).show(study, out, json, figures)


@arm_studies.command()
def excitation(
    starts: Annotated[int, Option(min=1, help="Random starts, from seed 0.")] = 5,
    evaluations: Annotated[
        int, Option(min=100, help="Condition numbers each search may take of each start.")
    ] = 3000,
    trajectory: Annotated[
        Path | None, Option(help="File for one period of the best one, as text at 200 Hz.")
    ] = None,
    out: TablesFile = None,
    json: JsonFlag = False,
) -> None:
    """Design an arm's excitation within its limits at every instant, compared with the thesis'."""
    from rig.arm.excitation import page, run_excitation, write_trajectory

    require_new(trajectory)
    with counted("starts") as on_start:
        study, best = run_excitation(starts, evaluations, on_start)
    if trajectory is not None:
        write_trajectory(best, trajectory)
    page(study).show(study, out, json)


def _of_simulated_arms(name: str) -> Callable[..., None]:
    """Return the command of a study on simulated arms of every family of hidden torque."""

    def command(
        seeds: Annotated[
            int, Option(min=1, help="Simulated arms of each family, from seed 0.")
        ] = 2,
        workers: WorkersOption = 1,
        state: StateFolder = None,
        out: TablesFile = None,
        figures: FiguresFolder = None,
        json: JsonFlag = False,
    ) -> None:
        from rig.arm.hidden import FAMILIES

        page, made = (import_module(f"rig.studies.{name}.{part}") for part in ("page", "study"))
        with resumable(state, name, seeds * len(FAMILIES), workers) as keeper:
            study = made.run(seeds, keeper)
        page.page(study).show(study, out, json, figures)

    return command


for _name, _what in {
    "wrench": "Make tables 3.1 to 3.3 of Piqué 2018 again on simulated arms: free space and"
    " contact.",
    "delsol": "Make tables 1, 2 and 5 of del Sol et al. 2014 again on simulated hydraulic arms.",
    "zhang": "Make Zhang et al. 2022 again on simulated arms: torque in free space, grasp and"
    " wrench.",
}.items():
    arm_studies.command(_name, help=_what)(_of_simulated_arms(_name))


@arm_studies.command()
def payload(
    data: ArmData,
    on: Annotated[list[str], Option(help="A run to look for an added mass on.")],
    model: Annotated[str, Option(help="Run without the mass, to fit a model on.")] = "two18",
    height_m: Annotated[
        float, Option(min=0.01, help="Height of the mass above the remote centre, m.")
    ] = 0.535,
    height_error_m: Annotated[
        float, Option(min=0.0, help="Standard error of that height, m.")
    ] = 0.01,
    out: TablesFile = None,
    json: JsonFlag = False,
) -> None:
    """Find a mass added to an arm's insertion axis from its joints' torque."""
    from rig.arm.payload import find_payload, page
    from rig.arm.search import open_paths

    with described("paths") as step:
        fitted, *runs = open_paths(data, [model, *on])
        found = find_payload(fitted, runs, height_m, height_error_m, step)
    page(found).show(found, out, json)
