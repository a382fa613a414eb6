"""`rig record`: run a protocol and write one log per run."""

import shlex
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from rig.cli import options
from rig.errors import KNOWN_ERRORS, UsageError
from rig.output.console import JsonFlag, emit_json, present, progress, remarks
from rig.output.table import counted

if TYPE_CHECKING:
    from rig.configuration.config import Config
    from rig.protocols.protocol import Plan
    from rig.recording.campaign import RunResult
    from rig.recording.watch import RunWatch


def record(
    protocol: Annotated[
        str | None,
        Option(
            "--protocol",
            "-p",
            help=f"Protocol: a file, or one of {', '.join(options.protocol_names())}. If none:"
            " diagnosis; unloaded without a load motor, grasper on a grasper.",
            autocompletion=options.complete_protocol,
        ),
    ] = None,
    config: options.ConfigOption = None,
    sim: options.SimFlag = False,
    out: Annotated[Path | None, Option("--out", "-o", help="Folder of the campaign.")] = None,
    resume: Annotated[
        Path | None, Option("--resume", help="Resume the campaign in this folder.")
    ] = None,
    seed: options.SimulationSeed = None,
    model: Annotated[
        Path | None,
        Option("--model", "-m", help="Fitted model to monitor for a change of the rig."),
    ] = None,
    notes: Annotated[str, Option(help="Operator's notes, stored in every log.")] = "",
    json: JsonFlag = False,
) -> int:
    """Run a protocol on the rig and write one log per run to logs/.

    Exit code 1 when a run is incomplete or a sensor's zero drifted beyond its limit. Interrupted
    with --json, the object has the runs so far and the command that goes on.
    """
    from calibration.rules import refuse_errors
    from rig.configuration.check import refuse_problems
    from rig.machines.choose import machine_of
    from rig.protocols.protocol import load_protocol
    from rig.recording.campaign import open_campaign_folder, read_manifest

    screen = remarks()
    if resume is not None:
        if (protocol, config, out, seed) != (None, None, None, None) or sim:
            raise UsageError(
                "--resume goes on as the campaign was begun.",
                "Protocol, configuration, folder and seed are those of the campaign.",
                f"Type `rig record --resume {resume}` alone.",
            )
        plan, settings = read_manifest(resume)
        options.announced(settings)
        folder = resume
    else:
        settings = options.chosen_rig(config, sim)
        if seed is not None:
            settings = settings.changed(simulation={"seed": seed})
        first = machine_of(settings).first_look(settings)
        # of a rig that can play it, the campaign that is to be diagnosed
        plan = load_protocol(protocol or ("diagnosis" if first == "quick" else first))
        folder = out or Path("logs") / f"{datetime.now():%Y-%m-%d-%H%M%S}-{plan.name}"
    refuse_problems(settings)
    for verdict in refuse_errors(settings.calibration_verdicts()):
        screen.print(f"{verdict.channel}: {verdict.message} ({verdict.rule})")
    watch = None if model is None else _watch(model, settings)
    todo = open_campaign_folder(folder, plan, settings, resume=resume is not None)
    screen.print(f"{plan.name}: {counted(len(todo), 'run')} on {settings.name} into {folder}")
    recorded = _recorded(settings, todo, folder, notes, watch, json)
    bad = [result.name for result in recorded if result.drifted or not result.complete]
    wrong = f"drifted or not complete: {', '.join(bad)}" if bad else "all complete"
    found = {"folder": folder, "runs": recorded, "look_at": bad}
    models = {} if watch is None else {"models": watch.to_json()}
    said = f"{counted(len(recorded), 'run')} recorded, {wrong}. Next: rig log check {folder}"
    present(json, found | models, said)
    return 1 if bad else 0


def _watch(model: Path, settings: "Config") -> "RunWatch":
    """Begin to monitor a fitted model, whose channels are those of the rig's logger."""
    from rig.live.estimator import require_channels
    from rig.log.devices import channel_of
    from rig.recording.watch import watch_runs

    watch = watch_runs(model)
    of_devices = tuple(channel_of(name, "") for name in settings.devices)
    of_logger = {name for name in watch.channels if not name.startswith(of_devices)}
    require_channels(of_logger, settings, model)
    return watch


def _recorded(
    settings: "Config",
    todo: "list[Plan]",
    folder: Path,
    notes: str,
    watch: "RunWatch | None",
    json: bool,
) -> "list[RunResult]":
    """Record the runs and show how they go; state how to go on if not all are."""
    from rig.bench.logger import open_logger
    from rig.bench.session import Session
    from rig.recording.campaign import record_campaign

    screen = remarks()
    recorded: list[RunResult] = []
    resume = f"rig record --resume {shlex.quote(str(folder))}"
    try:
        with Session(settings, open_logger(settings)) as session, progress() as bar:
            task = bar.add_task("recording", total=sum(run.samples for run in todo))
            done = 0

            def show(name: str, taken: int, expected: int) -> None:
                bar.update(task, completed=done + taken, description=name)

            for result in record_campaign(session, todo, folder, notes=notes, on_progress=show):
                done += result.expected
                recorded.append(result)
                if bar.disable:  # no terminal: a line a run in place of the bar
                    screen.print(f"{len(recorded)}/{len(todo)} {result.name}")
                if watch is not None and (news := watch.after(result.path)):
                    bar.console.print(news, style="yellow")
                if result.drifted or not result.complete:
                    bar.console.print(f"{result.name}: {result.remark}", style="yellow")
    except KeyboardInterrupt:
        screen.print(f"Stopped; the rig is safe. Go on with: {resume}")
        if json:
            stopped = {"interrupted": True, "resume": resume}
            emit_json({"folder": folder, "runs": recorded, **stopped})
        raise
    except KNOWN_ERRORS:
        screen.print(
            f"{len(recorded)} of {len(todo)} runs are recorded. Go on, once it is put right, with: "
            f"{resume}"
        )
        raise
    return recorded
