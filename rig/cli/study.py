"""`rig study`: make a paper's results again."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.output import JsonFlag, console, emit_json, progress

if TYPE_CHECKING:
    from rig.studies.oneill import Source
    from rig.studies.oneill_networks import NetworkStudy

study_app = typer.Typer(
    name="study",
    help="Make a paper's results again, on measured or simulated data.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@study_app.callback()
def studies() -> None:
    """Make a paper's results again, on measured or simulated data."""


@study_app.command()
def oneill(
    data: Annotated[
        Path | None,
        typer.Option(help="Measured data: a folder or archive. Without it, a simulated campaign."),
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Folder for the HTML report.")] = None,
    out: Annotated[Path | None, typer.Option(help="File for the tables in Markdown.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of splits and of the simulation.")] = 0,
    networks: Annotated[
        bool, typer.Option("--networks", help="Also train the networks: long, can be resumed.")
    ] = False,
    minutes: Annotated[
        float | None, typer.Option(help="Start no network after so long; tables say what lacks.")
    ] = None,
    every: Annotated[int, typer.Option(min=1, help="Train on every n-th closing sample.")] = 8,
    workers: Annotated[int, typer.Option(min=1, help="Networks trained at once.")] = 1,
    state: Annotated[
        Path | None, typer.Option(help="Folder of trained networks; a cache folder by default.")
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Make the results of O'Neill et al. 2018 again: Table I's linear rows, and its networks."""
    from estimation.files import write_text_atomic
    from rig.reports import oneill as shown
    from rig.reports.render import write_report
    from rig.reports.table import to_rich
    from rig.studies.oneill import open_reference, run_study

    source = _simulated(seed) if data is None else open_reference(data)
    with progress() as bar:
        task = bar.add_task("runs", total=len(source.campaign))
        result = run_study(source, seed=seed, on_run=lambda name: bar.advance(task))
    deep = None
    if networks:
        left_out = result.study.left_out
        training = Training(minutes, every, workers, state)
        deep = _train(source, left_out, data, training, seed)
    screen = console()
    screen.print(shown.lead(result.study), markup=False)
    for note in [f"Data: {source.name}.", *shown.all_notes(result.study, deep)]:
        screen.print(note, markup=False)
    for table in shown.all_tables(result.study, deep):
        screen.print(to_rich(table))
    if out is not None:
        write_text_atomic(out, shown.markdown(result.study, deep))
        screen.print(f"Markdown: {out}", markup=False)
    if report is not None:
        page = write_report(report / "oneill.html", shown.page(result, deep))
        screen.print(f"Report: {page}", markup=False)
    if json:
        emit_json({**asdict(result.study), **({"networks": deep} if deep is not None else {})})


@dataclass(frozen=True)
class Training:
    """How long, on what and where networks are trained; see the command's options."""

    minutes: float | None
    every: int
    workers: int
    state: Path | None


def _train(
    source: "Source", left_out: dict[str, str], data: Path | None, training: Training, seed: int
) -> "NetworkStudy":
    from rig.studies.oneill_data import network_tables
    from rig.studies.oneill_networks import run_networks

    with progress() as bar:
        task = bar.add_task("closing samples", total=None)
        tables, notes = network_tables(
            source.campaign, left_out, data, on_run=lambda name: bar.advance(task)
        )
        trained = bar.add_task("networks", total=None)
        return run_networks(
            tables,
            training.state or Path.home() / ".cache" / "rig" / "oneill",
            every=training.every,
            seed=seed,
            workers=training.workers,
            minutes=float("inf") if training.minutes is None else training.minutes,
            notes=notes,
            on_network=lambda done, total: bar.update(trained, completed=done, total=total),
        )


@study_app.command()
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
    out: Annotated[Path | None, typer.Option(help="File for the tables in Markdown.")] = None,
    json: JsonFlag = False,
) -> None:
    """Make table 3.2 of Piqué 2018 again: an arm's joint torques in free space."""
    from estimation.files import write_text_atomic
    from rig.reports import pique as shown
    from rig.reports.table import to_rich
    from rig.studies.arm_search import open_paths
    from rig.studies.pique import run_study

    with progress() as bar:
        task = bar.add_task("paths", total=None)
        first, second, *others = open_paths(data, [*paths, *(also or [])])
        study = run_study(
            first, second, also=others, on_step=lambda step: bar.update(task, description=step)
        )
    screen = console()
    for line in [shown.lead(study), *shown.notes(study)]:
        screen.print(line, markup=False)
    for table in shown.tables(study):
        screen.print(to_rich(table))
    if out is not None:
        write_text_atomic(out, shown.markdown(study))
        screen.print(f"Markdown: {out}", markup=False)
    if json:
        emit_json(study)


@study_app.command()
def wrench(
    seeds: Annotated[int, typer.Option(min=1, help="Simulated arms, from seed 0.")] = 20,
    workers: Annotated[int, typer.Option(min=1, help="Arms at once.")] = 1,
    out: Annotated[Path | None, typer.Option(help="File for the tables in Markdown.")] = None,
    json: JsonFlag = False,
) -> None:
    """Make tables 3.1 to 3.3 of Piqué 2018 again on simulated arms: free space and contact."""
    from estimation.files import write_text_atomic
    from rig.reports import pique_wrench as shown
    from rig.reports.table import to_rich
    from rig.studies.pique_wrench import run_wrench_study

    with progress() as bar:
        task = bar.add_task("arms", total=seeds)
        study = run_wrench_study(seeds, workers, lambda: bar.advance(task))
    screen = console()
    for note in shown.NOTES:
        screen.print(note, markup=False)
    for table in shown.tables(study):
        screen.print(to_rich(table))
    if out is not None:
        write_text_atomic(out, shown.markdown(study))
        screen.print(f"Markdown: {out}", markup=False)
    if json:
        emit_json(study)


@study_app.command()
def delsol(
    seeds: Annotated[int, typer.Option(min=1, help="Simulated arms, from seed 0.")] = 20,
    out: Annotated[Path | None, typer.Option(help="File for the tables in Markdown.")] = None,
    json: JsonFlag = False,
) -> None:
    """Make tables 1, 2 and 5 of del Sol et al. 2014 again on simulated hydraulic arms."""
    from estimation.files import write_text_atomic
    from rig.reports.table import to_markdown, to_rich
    from rig.simulation.hydraulic_arm import HYDRAULIC
    from rig.studies.delsol import run_delsol, tables

    with progress() as bar:
        task = bar.add_task("arms", total=seeds)
        study = run_delsol(seeds, lambda: bar.advance(task))
    screen = console()
    note = f"Arm: {HYDRAULIC.name}; {HYDRAULIC.source}."
    screen.print(note, markup=False)
    for table in tables(study):
        screen.print(to_rich(table))
    if out is not None:
        title = "# External forces of a hydraulic arm: del Sol et al. 2014 on simulated arms"
        parts = [title, note, *(to_markdown(table).rstrip() for table in tables(study))]
        write_text_atomic(out, "\n\n".join([*parts, study.provenance.line()]) + "\n")
        screen.print(f"Markdown: {out}", markup=False)
    if json:
        emit_json(study)


@study_app.command()
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
    out: Annotated[Path | None, typer.Option(help="File for the table in Markdown.")] = None,
    json: JsonFlag = False,
) -> None:
    """Find a mass added to an arm's insertion axis from its joints' torque."""
    from estimation.files import write_text_atomic
    from rig.reports.table import to_markdown, to_rich
    from rig.studies.arm_search import open_paths
    from rig.studies.payload import find_payload, table

    with progress() as bar:
        task = bar.add_task("paths", total=None)
        fitted, *runs = open_paths(data, [model, *on])
        found = find_payload(
            fitted, runs, height_m, height_error_m, lambda name: bar.update(task, description=name)
        )
    screen = console()
    screen.print(to_rich(table(found)))
    if out is not None:
        text = f"# Masses added to an arm\n\n{to_markdown(table(found))}"
        write_text_atomic(out, f"{text}\n{found.provenance.line()}\n")
        screen.print(f"Markdown: {out}", markup=False)
    if json:
        emit_json(found)


def _simulated(seed: int) -> "Source":
    from rig.simulation.campaign import simulate_reference_campaign
    from rig.studies.oneill import Source

    return Source(
        simulate_reference_campaign(seed),
        name=f"simulated reference campaign, seed {seed}",
        measured=False,
    )
