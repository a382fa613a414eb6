"""`rig study`: make a paper's results again."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from rig.cli.options import FiguresFolder, SeedOption, TablesFile, WorkersOption, group
from rig.cli.study_arm import StateFolder, arm_studies, resumable
from rig.configuration.folders import cache_folder
from rig.errors import UsageError
from rig.output.console import JsonFlag, counted, counting, described

study_app = group("study", "Reproduce a paper's results, on measured or simulated data.")
study_app.add_typer(arm_studies)


@study_app.command()
def oneill(
    data: Annotated[
        Path | None,
        Option(help="Measured data: a folder or archive. Without it, a simulated campaign."),
    ] = None,
    out: TablesFile = None,
    seed: SeedOption = 0,
    networks: Annotated[
        bool, Option("--networks", help="Also train the networks: long, can be resumed.")
    ] = False,
    states: Annotated[
        bool, Option("--states", help="Also estimate from physical states: some minutes.")
    ] = False,
    kinds: Annotated[
        bool, Option("--kinds", help="Also fit every kind of estimator on the same folds.")
    ] = False,
    figures: FiguresFolder = None,
    minutes: Annotated[
        float | None, Option(help="Start no network after this time, min; tables list the rest.")
    ] = None,
    every: Annotated[int, Option(min=1, help="Train on every n-th closing sample.")] = 8,
    workers: WorkersOption = 1,
    state: Annotated[
        Path | None, Option(help="Folder of trained networks; a cache folder by default.")
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Reproduce Tables I to V of O'Neill et al. 2018, and fit better estimators.

    By default it fits Table I's linear models, in seconds. --networks trains the paper's networks,
    which takes long; after an interruption it resumes. --states and --kinds take minutes.
    """
    from rig.studies.oneill.data import open_reference, simulated_reference
    from rig.studies.oneill.page import page
    from rig.studies.oneill.study import run_study

    source = simulated_reference(seed) if data is None else open_reference(data)
    with counting("runs", len(source.campaign)) as on_run:
        study = run_study(source, seed=seed, on_run=on_run)
    campaign = source.campaign.exclude(study.left_out)
    deep, physical, every_kind = None, None, None
    shown: dict[str, list[Any]] = {}
    if networks:
        from rig.studies.oneill.networks import Training, network_tables, run_networks

        kept = state or cache_folder() / "oneill"
        limit = float("inf") if minutes is None else minutes
        training = Training(kept, every=every, seed=seed, workers=workers, minutes=limit)
        with counting("closing samples") as on_run:
            tables, notes = network_tables(campaign, data, on_run=on_run)
        with counted("networks") as on_network:
            deep = run_networks(tables, training, notes, on_network)
    if states:
        from rig.studies.oneill.states import run_states

        keep = None if figures is None else shown.__setitem__
        with counted("estimates from states") as on_row:
            physical = run_states(campaign, data, seed=seed, on_row=on_row, on_shown=keep)
    if kinds:
        from rig.studies.oneill.kinds import run_kinds

        with counted("kinds of estimators") as on_fit:
            every_kind = run_kinds(campaign, seed, on_fit)
    found = {"networks": deep, "states": physical, "kinds": every_kind}
    whole = asdict(study) | {name: each for name, each in found.items() if each is not None}
    page(study, deep, physical, every_kind or (), shown).show(whole, out, json, figures)


@study_app.command()
def zhao(
    prototype: Annotated[str, Option(help="third, journal or ball.")] = "third",
    seeds: Annotated[int, Option(min=2, help="Simulated graspers of each family.")] = 4,
    spread: Annotated[float, Option(min=0, max=0.3, help="Spread of hidden parameters.")] = 0.1,
    workers: WorkersOption = 1,
    state: StateFolder = None,
    out: TablesFile = None,
    figures: FiguresFolder = None,
    json: JsonFlag = False,
) -> None:
    """Reproduce Tables 2 to 4 and the haptic experiments of Zhao and Nelson 2016, simulated."""
    from estimation.model_file import parse
    from rig.grasper.hidden import FAMILIES, OWN
    from rig.grasper.plant import PROTOTYPES
    from rig.studies.zhao.haptics import haptics_of
    from rig.studies.zhao.page import page
    from rig.studies.zhao.study import run_study

    if prototype not in PROTOTYPES:
        raise UsageError(
            f"There is no prototype {prototype!r}.", f"Known: {', '.join(PROTOTYPES)}."
        )
    steps = (3 + seeds) * len(FAMILIES) + seeds  # three diagnoses a family, and haptics
    with resumable(state, "zhao", steps, workers, "graspers") as keeper:
        study = run_study(prototype, seeds, spread, keeper)
        model = parse(study.lacking[OWN, "grasp"].model)
        haptics = haptics_of(prototype, seeds, spread, model, keeper)
    cells = {"prototype": study.prototype, "spread": study.spread, "cells": study.cells}
    found = {", ".join(key): each.findings for key, each in study.lacking.items()}
    whole = {"study": {**cells, "findings": found}, "haptics": haptics}
    page(study, haptics).show(whole, out, json, figures)


@study_app.command()
def loop(
    data: Annotated[Path, Option(help="Folder or archive of the reference rig's runs.")],
    seed: SeedOption = 0,
    task: Annotated[
        list[int] | None, Option(help="Only this row of the table, from 1; may be repeated.")
    ] = None,
    out: TablesFile = None,
    json: JsonFlag = False,
) -> None:
    """Add effects to the paper's linear models, confirmed on held-out test runs."""
    from rig.studies.loop.page import page
    from rig.studies.loop.study import TASKS, run_study

    if any(not 1 <= number <= len(TASKS) for number in task or []):
        raise UsageError(f"There are {len(TASKS)} rows.", fix="Write for example --task 1.")
    tasks = [TASKS[number - 1] for number in task] if task else TASKS
    with described("loop") as step:
        study = run_study(data, seed, tasks, on_stage=step)
    page(study).show(study, out, json)


@study_app.command()
def instruments(
    data: Annotated[Path, Option(help="Folder of the measured data's folders or archives.")],
    source: Annotated[str, Option(help="Instrument to fit on.")] = "Tool_4_Maryland_L_4",
    other: Annotated[
        list[str] | None, Option(help="Instrument to adapt to; may be repeated.")
    ] = None,
    networks: Annotated[bool, Option(help="Train networks too: minutes.")] = True,
    seed: SeedOption = 0,
    out: TablesFile = None,
    json: JsonFlag = False,
) -> None:
    """Adapt one instrument's estimators to others, with one run or three."""
    from rig.importers.registry import open_campaign
    from rig.studies.instruments.page import page
    from rig.studies.instruments.study import run_instruments
    from rig.studies.oneill.data import part_of

    others = other or ["Tool_4_Maryland_L_2", "Tool_5_Maryland_L_2"]
    with counted("instruments") as on_row:
        study = run_instruments(
            (source, open_campaign(part_of(data, source))),
            {name: open_campaign(part_of(data, name)) for name in others},
            networks=networks,
            seed=seed,
            on_row=on_row,
        )
    page(study).show(study, out, json)


@study_app.command()
def intervals(
    data: Annotated[Path, Option(help="Folder of the measured data's folders or archives.")],
    instrument: Annotated[
        list[str] | None, Option(help="Instrument to use; may be repeated.")
    ] = None,
    source: Annotated[
        list[str] | None,
        Option(help="One to adapt to all others; may be repeated; the first three."),
    ] = None,
    seed: SeedOption = 0,
    out: TablesFile = None,
    json: JsonFlag = False,
) -> None:
    """Measure how often intervals hold, on levels left out and on other instruments."""
    from rig.importers.registry import open_campaign
    from rig.studies.instruments.intervals import INSTRUMENTS, run_intervals
    from rig.studies.instruments.intervals_page import page
    from rig.studies.oneill.data import part_of

    names = instrument or INSTRUMENTS
    campaigns = {name: open_campaign(part_of(data, name)) for name in names}
    with described("intervals") as step:
        study = run_intervals(campaigns, source or names[:3], seed, on_step=step)
    page(study).show(study, out, json)


@study_app.command()
def machines(
    data: Annotated[
        Path,
        Argument(
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
    from rig.studies.machines.page import page
    from rig.studies.machines.study import run_study

    if not data.is_dir():
        raise UsageError(f"There is no folder {data}.", fix="Name the folder of the recordings.")
    with described("machines") as step:
        study = run_study(data, seed, on_stage=step)
    if not study.rows:
        raise UsageError(
            f"No machine's recordings are in {data}.",
            " ".join(study.skipped),
            "Put emps, smart-grasper, sts3215 or ur10e there.",
        )
    page(study).show(study, out, json)
