"""`rig diagnose | diff | loop`: what a declared model lacks, what changed, what to record next."""

import shlex
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from estimation.files import OutputError, check_output
from rig.cli import options
from rig.errors import UsageError
from rig.output.console import JsonFlag, counted, counting, present, progress, remarks, results
from rig.output.table import TextTable

if TYPE_CHECKING:
    from rich.console import Console

    from estimation.causes.verdict import Answer
    from rig.diagnosis.loop import Round


def diagnose(
    path: options.RecordingsArgument,
    model: options.ModelOption = None,
    machine: options.MachineOption = None,
    balance: options.EquationOption = None,
    json_: JsonFlag = False,
    json_out: options.JsonFile = None,
    report: Annotated[
        Path | None, Option(help="Folder of the HTML report; of a folder of logs, diagnosis in it.")
    ] = None,
    model_out: Annotated[
        Path | None, Option(help="File of the models with the identified effects.")
    ] = None,
    seed: options.SeedOption = 0,
    workers: options.WorkersOption = 1,
    quick: options.QuickFlag = False,
    scheduler: options.SchedulerOption = None,
    protocol_out: Annotated[
        Path | None, Option(help="Protocol file of the next experiment.")
    ] = None,
    ledger: options.LedgerOption = None,
    plan: Annotated[
        bool,
        Option(
            "--plan",
            help="PATH is a protocol or recordings: which effects such runs can distinguish.",
        ),
    ] = False,
    skip_bad: options.SkipBad = False,
    exclude: options.ExcludeOption = None,
    format_: options.FormatOption = None,
) -> None:
    """Identify the effect that the declared model lacks, and confirm it on held-out test runs."""
    if plan:
        _plan(path, model, balance, machine, json_)
        return
    options.require_machine(machine)
    from estimation.file_kinds import DIAGNOSIS, HTML, MODEL, PROTOCOL
    from rig.campaigns.work import engine
    from rig.diagnosis.durations import timed_stages
    from rig.diagnosis.ledger import Ledger, default_ledger
    from rig.diagnosis.propose import write_protocol
    from rig.diagnosis.run import run_diagnosis
    from rig.diagnosis.subject import subject
    from rig.reports.diagnosis import write
    from rig.reports.diagnosis_words import lines

    kept = _kept_with(path)
    page_file = report / "diagnosis.html" if report else kept and kept.with_suffix(".html")
    json_out = json_out or kept
    for output, kind in {json_out: DIAGNOSIS, page_file: HTML}.items():
        check_output(output, kind)
    for made, kind in {model_out: MODEL, protocol_out: PROTOCOL}.items():
        check_output(made, kind)
        options.require_new(made)
    looks = Ledger(ledger or default_ledger())
    with engine(workers, scheduler) as executor:
        asked = subject(path, model, balance, format_, machine, skip_bad)
        asked = replace(asked, campaign=options.without(path, asked.campaign, exclude))
        with timed_stages(asked, quick) as on_stage:
            done, look = run_diagnosis(
                asked, looks, seed=seed, executor=executor, quick=quick, on_stage=on_stage
            )
    # files first, then the ledger, then the screen: held-out runs are not used up by a diagnosis
    # that left nothing, and nobody sees a result that the ledger does not hold
    done, written = _with_models(done, model_out, path, machine) if model_out else (done, [])
    if protocol_out is not None:
        written.append(write_protocol(done.diagnosis, protocol_out))
    written += write(done, seed, page_file, json_out)
    looks.enter(look)
    found = done.diagnosis
    present(json_, found.to_json(), *lines(found), *written)


def _with_models(
    done: "Answer", model_out: Path, path: Path, machine: Path | None
) -> "tuple[Answer, list[str]]":
    """Write the models; return the diagnosis with their errors as they run live, and the lines."""
    from estimation import model_file
    from estimation.estimators.c_header import refused
    from rig.diagnosis.traces import with_cost_of_causal_filters

    done = with_cost_of_causal_filters(done)
    model_file.write_all(done.models, model_out)
    # a model in use is one of a configured rig, which a machine of a file alone has not
    use = ["rig", "model", "use", str(model_out)]
    if machine is not None:
        use = ["rig", "replay", str(path), "--machine", str(machine), "--model", str(model_out)]
    lines = [f"Model: {model_out}", f"To estimate with it: {shlex.join(use)}"]
    for model in done.models:
        if why := refused(model):
            lines.append(f"{model.balance}: `rig export` cannot write it: {why}")
    return done, lines


def _kept_with(path: Path) -> Path | None:
    """Return the file of a campaign's diagnosis in its folder; None where it cannot be kept."""
    from estimation import file_kinds
    from rig.campaigns.index import DIAGNOSIS

    if not path.is_dir() or not any(path.glob("*.mcap")):
        return None
    kept = path / DIAGNOSIS
    try:
        check_output(kept, file_kinds.DIAGNOSIS)
        check_output(kept.with_suffix(".html"), file_kinds.HTML)
    except OutputError as error:
        remarks().print(f"The page is not kept with the recordings: {error}")
        return None
    return kept


def _plan(
    path: Path, model: Path | None, balance: str | None, machine: Path | None, json_: bool
) -> None:
    from rig.diagnosis.plan import plan_of, sentences

    with counted("effects") as count:
        found = plan_of(path, model, balance, machine, count)
    present(json_, found.to_json(), *sentences(found))


def diff(
    a: Annotated[Path, Argument(help="Recordings of the first campaign.")],
    b: Annotated[Path, Argument(help="Recordings of the second campaign.")],
    model: options.ModelOption = None,
    machine: options.MachineOption = None,
    balance: options.EquationOption = None,
    on: Annotated[Path | None, Option(help="Recordings of a third campaign, to predict.")] = None,
    seed: options.SeedOption = 0,
    format_: options.FormatOption = None,
    json_: JsonFlag = False,
) -> None:
    """Find what changed between two campaigns of one machine, with intervals over runs.

    Two dates, two instruments, before and after a repair: which declared parameters moved, which
    effects came or went. A change is stated where it predicts runs left out better than none does.
    """
    from estimation.changes.compare import compare
    from rig.diagnosis.subject import subject
    from rig.reports.changes import change_table, lines, prediction_table

    first = subject(a, model, balance, format_, machine)
    second = subject(b, model, balance, format_, machine)
    third = () if on is None else subject(on, model, balance, format_, machine).campaign.evidence
    for path, campaign in ((a, first.campaign), (b, second.campaign)):
        options.say_left_out(path, campaign)
    both = first.campaign.evidence, second.campaign.evidence
    with counting("changes", total=1) as done:
        found = compare(*both, first.models, third, seed)
        done()
    shown: list[str | TextTable] = [*lines(found)]
    shown += [change_table(found)] if found.changes else []
    shown += [prediction_table(found)] if found.predicted else []
    present(json_, found, *shown)


def loop(
    sim: options.SimFlag = False,
    hide: Annotated[
        list[str] | None,
        Option(
            help="Hidden effect, or effect=strength; by default drawn by the seed; `none` for none."
        ),
    ] = None,
    balance: options.EquationOption = None,
    protocol: Annotated[
        str | None, Option("--protocol", "-p", help="First protocol; by default `diagnosis`.")
    ] = None,
    out: options.OutFolder = None,
    rounds: Annotated[int, Option(help="Maximum number of campaigns.")] = 3,
    minutes: Annotated[float, Option(help="No round starts after this time, min.")] = 20.0,
    seed: options.SimulationSeed = None,
    quick: options.QuickFlag = False,
    workers: options.WorkersOption = 1,
    scheduler: options.SchedulerOption = None,
    json: JsonFlag = False,
) -> None:
    """Record, diagnose and choose the next experiment, until the effect is unique.

    Ends when every effect is unique, when the model is complete, or at the limit of rounds or time.
    """
    from rig.campaigns.work import engine
    from rig.configuration.config import load_config
    from rig.diagnosis.loop import Budget, Round, run_loop
    from rig.diagnosis.subject import declared_models
    from rig.protocols.protocol import load_protocol
    from rig.simulation.hidden import chosen

    if not sim:
        raise UsageError("The loop moves the simulated rig only.", fix="Type `rig loop --sim`.")
    screen, now = results(json), datetime.now()
    number = seed if seed is not None else int(now.timestamp()) % 1000
    hidden = chosen(hide, number)
    settings = load_config().changed(
        simulation={"seed": number, "hidden": hidden, "plant": "declared"}
    )
    folder = out or Path("logs") / f"loop-{now:%Y-%m-%d-%H%M%S}"
    remarks().print(f"rig loop, seed {number}: everything goes to {folder}")
    made: list[Round] = []
    with engine(workers, scheduler) as executor, progress() as bar:
        task = bar.add_task("samples", total=None)

        def count(name: str, samples: int, expected: int) -> None:
            bar.update(task, completed=samples, total=expected, description=name)

        for one in run_loop(
            folder,
            settings,
            declared_models(None, balance),
            Budget(rounds, minutes),
            first=load_protocol(protocol) if protocol else None,
            seed=number,
            executor=executor,
            quick=quick,
            on_stage=lambda text: bar.console.print(f"- {text}"),
            on_progress=count,
        ):
            made.append(one)
            bar.stop()
            _report(one, folder, number, screen)
            bar.start()
    drawn = ", ".join(f"{name} ({strength:g})" for name, strength in hidden.items())
    last = {"stopped": made[-1].stopped, "rounds": [one.to_json() for one in made]}
    data = {"folder": folder, "hidden": hidden, **last}
    present(json, data, f"Hidden effects: {drawn or 'none'}.")


def _report(one: "Round", folder: Path, seed: int, screen: "Console") -> None:
    """Print the sentences of a round, and write its page."""
    from rig.reports.diagnosis import write
    from rig.reports.diagnosis_words import next_sentence, sentences

    found = one.done.diagnosis
    written = write(one.done, seed, folder / f"round-{one.number}" / "diagnosis.html")
    for line in (*sentences(found), *written, one.stopped or next_sentence(found)):
        screen.print(line)
