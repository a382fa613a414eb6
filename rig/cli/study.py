"""`rig study`: make a paper's results again."""

import os
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.help import GroupedHelp
from rig.cli.options import FiguresFolder, SeedOption, TablesFile, WorkersOption
from rig.cli.study_arm import StateFolder, arm_studies, resumable
from rig.cli.study_machines import machine_studies
from rig.output.console import JsonFlag, emit_json, progress, show_result

if TYPE_CHECKING:
    from estimation.campaign import Campaign
    from rig.studies.oneill.kinds import KindRow
    from rig.studies.oneill.networks import NetworkStudy, Training
    from rig.studies.oneill.source import Source
    from rig.studies.oneill.states import StateStudy

study_app = typer.Typer(
    name="study",
    help="Reproduce a paper's results, on measured or simulated data.",
    cls=GroupedHelp,
    no_args_is_help=True,
    rich_markup_mode=None,
)


study_app.add_typer(arm_studies)
study_app.add_typer(machine_studies)


@study_app.callback()
def studies() -> None:
    """Reproduce a paper's results, on measured or simulated data."""


@study_app.command()
def oneill(
    data: Annotated[
        Path | None,
        typer.Option(help="Measured data: a folder or archive. Without it, a simulated campaign."),
    ] = None,
    out: TablesFile = None,
    seed: SeedOption = 0,
    networks: Annotated[
        bool, typer.Option("--networks", help="Also train the networks: long, can be resumed.")
    ] = False,
    states: Annotated[
        bool, typer.Option("--states", help="Also estimate from physical states: some minutes.")
    ] = False,
    kinds: Annotated[
        bool,
        typer.Option("--kinds", help="Also fit every kind of estimator on the same folds."),
    ] = False,
    figures: FiguresFolder = None,
    minutes: Annotated[
        float | None,
        typer.Option(help="Start no network after this time, min; tables list the rest."),
    ] = None,
    every: Annotated[int, typer.Option(min=1, help="Train on every n-th closing sample.")] = 8,
    workers: WorkersOption = 1,
    state: Annotated[
        Path | None, typer.Option(help="Folder of trained networks; a cache folder by default.")
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Reproduce Tables I to V of O'Neill et al. 2018, and fit better estimators.

    By default it fits Table I's linear models, in seconds. --networks trains the paper's networks,
    which takes long; after an interruption it resumes. --states and --kinds take minutes.
    """
    from rig.studies.oneill import page as shown
    from rig.studies.oneill.source import open_reference
    from rig.studies.oneill.study import run_study

    source = _simulated(seed) if data is None else open_reference(data)
    with progress() as bar:
        task = bar.add_task("runs", total=len(source.campaign))
        study = run_study(source, seed=seed, on_run=lambda name: bar.advance(task))
    campaign = source.campaign.exclude(study.left_out)
    deep = None
    if networks:
        from rig.studies.oneill.networks import Training

        kept = state or Path.home() / ".cache" / "rig" / "oneill"
        limit = float("inf") if minutes is None else minutes
        training = Training(kept, every=every, seed=seed, workers=workers, minutes=limit)
        deep = _train(campaign, data, training)
    physical, drawn = _fit_states(campaign, data, seed, figures) if states else (None, [])
    every_kind = _fit_kinds(campaign, seed) if kinds else ()
    more = shown.More(deep, physical, every_kind)
    lines = [*shown.lead(study, more), f"Data: {source.name}.", *shown.all_notes(study, more)]

    def markdown() -> str:
        placed = [(name, os.path.relpath(at, out.parent)) for name, at in drawn] if out else []
        return shown.markdown(study, more, placed)

    show_result(lines, shown.all_tables(study, more), out, markdown, json)
    if json:
        found = {"networks": deep, "states": physical, "kinds": every_kind or None}
        emit_json(asdict(study) | {k: v for k, v in found.items() if v is not None})


def _train(campaign: "Campaign", data: Path | None, training: "Training") -> "NetworkStudy":
    from rig.studies.oneill.data import network_tables
    from rig.studies.oneill.networks import run_networks

    with progress() as bar:
        task = bar.add_task("closing samples", total=None)
        tables, notes = network_tables(campaign, data, on_run=lambda name: bar.advance(task))
        trained = bar.add_task("networks", total=None)
        return run_networks(
            tables,
            training,
            notes,
            on_network=lambda done, total: bar.update(trained, completed=done, total=total),
        )


def _fit_states(
    campaign: "Campaign", data: Path | None, seed: int, figures: Path | None
) -> tuple["StateStudy", list[tuple[str, Path]]]:
    from rig.studies.oneill.figures import write
    from rig.studies.oneill.shown import Shown
    from rig.studies.oneill.states import run_states

    kept: list[Shown] = []

    with progress() as bar:
        task = bar.add_task("closing samples", total=None)
        fitted = bar.add_task("estimates from states", total=None)
        study = run_states(
            campaign,
            data,
            seed=seed,
            on_run=lambda name: bar.advance(task),
            on_row=lambda done, total: bar.update(fitted, completed=done, total=total),
            on_shown=kept.append if figures is not None else None,
        )
    return study, write(figures, kept) if figures is not None else []


def _fit_kinds(campaign: "Campaign", seed: int) -> "tuple[KindRow, ...]":
    from rig.studies.oneill.kinds import run_kinds

    with progress() as bar:
        task = bar.add_task("kinds of estimators", total=None)
        return run_kinds(
            campaign,
            seed,
            on_fit=lambda done, total: bar.update(task, completed=done, total=total),
        )


@study_app.command()
def zhao(
    prototype: Annotated[str, typer.Option(help="third, journal or ball.")] = "third",
    seeds: Annotated[int, typer.Option(min=2, help="Simulated graspers of each family.")] = 4,
    spread: Annotated[
        float, typer.Option(min=0, max=0.3, help="Spread of hidden parameters.")
    ] = 0.1,
    workers: WorkersOption = 1,
    state: StateFolder = None,
    out: TablesFile = None,
    figures: FiguresFolder = None,
    json: JsonFlag = False,
) -> None:
    """Reproduce Tables 2 to 4 and the haptic experiments of Zhao and Nelson 2016, simulated."""
    from rig.errors import UsageError
    from rig.grasper.hidden import FAMILIES, OWN
    from rig.grasper.plant import PROTOTYPES
    from rig.studies.zhao import page as shown
    from rig.studies.zhao.haptics import haptics_of
    from rig.studies.zhao.study import run_study

    if prototype not in PROTOTYPES:
        raise UsageError(
            f"There is no prototype {prototype!r}.", f"Known: {', '.join(PROTOTYPES)}."
        )
    steps = (3 + seeds) * len(FAMILIES) + seeds  # three diagnoses a family, and haptics
    with resumable(state, "zhao", steps, workers, "graspers") as keeper:
        study = run_study(prototype, seeds, spread, keeper)
        model = study.lacking[OWN, "grasp"].model
        haptics = haptics_of(prototype, seeds, spread, model, keeper)
    drawn = shown.write_figures(figures, study, haptics) if figures is not None else []

    def markdown() -> str:
        names = [os.path.relpath(path, out.parent) for path in drawn] if out is not None else []
        return shown.markdown(study, haptics, names)

    lines = [shown.lead(study), *shown.notes(study)]
    show_result(lines, shown.tables(study, haptics), out, markdown, json)
    if json:
        cells = {"prototype": study.prototype, "spread": study.spread, "cells": study.cells}
        found = {", ".join(key): each.findings for key, each in study.lacking.items()}
        emit_json({"study": {**cells, "findings": found}, "haptics": haptics})


@study_app.command()
def loop(
    data: Annotated[Path, typer.Option(help="Folder or archive of the reference rig's runs.")],
    seed: SeedOption = 0,
    task: Annotated[
        list[int] | None, typer.Option(help="Only this row of the table, from 1; may be repeated.")
    ] = None,
    out: TablesFile = None,
    json: JsonFlag = False,
) -> None:
    """Add effects to the paper's linear models, confirmed on held-out test runs."""
    from rig.errors import UsageError
    from rig.studies.loop import page as shown
    from rig.studies.loop.study import TASKS, run_study

    if any(not 1 <= number <= len(TASKS) for number in task or []):
        raise UsageError(f"There are {len(TASKS)} rows.", fix="Write for example --task 1.")
    tasks = [TASKS[number - 1] for number in task] if task else TASKS
    with progress() as bar:
        shown_stage = bar.add_task("loop", total=None)
        study = run_study(
            data, seed, tasks, on_stage=lambda s: bar.update(shown_stage, description=s)
        )
    lines = [shown.lead(study), *shown.notes(study)]
    show_result(lines, shown.tables(study), out, lambda: shown.markdown(study), json)
    if json:
        emit_json(study)


@study_app.command()
def instruments(
    data: Annotated[Path, typer.Option(help="Folder of the measured data's folders or archives.")],
    source: Annotated[str, typer.Option(help="Instrument to fit on.")] = "Tool_4_Maryland_L_4",
    other: Annotated[
        list[str] | None, typer.Option(help="Instrument to adapt to; may be repeated.")
    ] = None,
    networks: Annotated[bool, typer.Option(help="Train networks too: minutes.")] = True,
    seed: SeedOption = 0,
    out: TablesFile = None,
    json: JsonFlag = False,
) -> None:
    """Adapt one instrument's estimators to others, with one run or three."""
    from rig.importers.registry import open_campaign
    from rig.studies.instruments import page as shown
    from rig.studies.instruments.study import run_instruments
    from rig.studies.oneill.source import part_of

    others = other or ["Tool_4_Maryland_L_2", "Tool_5_Maryland_L_2"]
    with progress() as bar:
        task = bar.add_task("instruments", total=None)
        study = run_instruments(
            (source, open_campaign(part_of(data, source))),
            {name: open_campaign(part_of(data, name)) for name in others},
            networks=networks,
            seed=seed,
            on_row=lambda done, total: bar.update(task, completed=done, total=total),
        )
    tables = [shown.table(study), shown.drawn_table(study)]
    show_result([shown.lead(study)], tables, out, lambda: shown.markdown(study), json)
    if json:
        emit_json(study)


@study_app.command()
def intervals(
    data: Annotated[Path, typer.Option(help="Folder of the measured data's folders or archives.")],
    instrument: Annotated[
        list[str] | None, typer.Option(help="Instrument to use; may be repeated.")
    ] = None,
    source: Annotated[
        list[str] | None,
        typer.Option(help="One to adapt to all others; may be repeated; the first three."),
    ] = None,
    seed: SeedOption = 0,
    out: TablesFile = None,
    json: JsonFlag = False,
) -> None:
    """Measure how often intervals hold, on levels left out and on other instruments."""
    from rig.importers.registry import open_campaign
    from rig.studies.instruments import intervals_page as shown
    from rig.studies.instruments.intervals import INSTRUMENTS, run_intervals
    from rig.studies.oneill.source import part_of

    names = instrument or INSTRUMENTS
    campaigns = {name: open_campaign(part_of(data, name)) for name in names}
    with progress() as bar:
        task = bar.add_task("intervals", total=None)
        study = run_intervals(
            campaigns,
            source or names[:3],
            seed,
            on_step=lambda what: bar.update(task, description=what),
        )
    show_result(shown.lead(study), shown.tables(study), out, lambda: shown.markdown(study), json)
    if json:
        emit_json(study)


def _simulated(seed: int) -> "Source":
    from rig.simulation.campaign import simulate_reference_campaign
    from rig.studies.oneill.source import Source

    return Source(
        simulate_reference_campaign(seed),
        name=f"simulated reference campaign, seed {seed}",
        measured=False,
    )
