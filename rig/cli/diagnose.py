"""`rig diagnose`: what does the declared model lack?"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from estimation.files import OutputError, check_output
from rig.cli.options import (
    EquationOption,
    FormatOption,
    JsonFile,
    LedgerOption,
    MachineOption,
    ModelOption,
    QuickFlag,
    RecordingsArgument,
    SchedulerOption,
    SeedOption,
    SkipBad,
    WorkersOption,
    say_left_out,
)
from rig.output.console import JsonFlag, present

if TYPE_CHECKING:
    from estimation.causes.verdict import Answer


def diagnose(
    path: RecordingsArgument,
    model: ModelOption = None,
    machine: MachineOption = None,
    balance: EquationOption = None,
    json_: JsonFlag = False,
    json_out: JsonFile = None,
    report: Annotated[
        Path | None, Option(help="Folder of the HTML report; of a folder of logs, diagnosis in it.")
    ] = None,
    model_out: Annotated[
        Path | None, Option(help="File of the models with the identified effects.")
    ] = None,
    seed: SeedOption = 0,
    workers: WorkersOption = 1,
    quick: QuickFlag = False,
    scheduler: SchedulerOption = None,
    protocol_out: Annotated[
        Path | None, Option(help="Protocol file of the next experiment.")
    ] = None,
    ledger: LedgerOption = None,
    plan: Annotated[
        bool,
        Option(
            "--plan",
            help="PATH is a protocol or recordings: which effects such runs can distinguish.",
        ),
    ] = False,
    skip_bad: SkipBad = False,
    format_: FormatOption = None,
) -> None:
    """Identify the effect that the declared model lacks, and confirm it on held-out test runs."""
    if plan:
        _plan(path, model, balance, machine, json_)
        return

    from estimation.file_kinds import DIAGNOSIS, HTML, MODEL, PROTOCOL
    from rig.diagnosis.durations import timed_stages
    from rig.diagnosis.ledger import Ledger, default_ledger
    from rig.diagnosis.propose import write_protocol
    from rig.diagnosis.run import run_diagnosis
    from rig.diagnosis.subject import subject
    from rig.diagnosis.work import engine
    from rig.reports.diagnosis import write
    from rig.reports.diagnosis_words import sentences

    kept = _kept_with(path)
    page_file = report / "diagnosis.html" if report else kept and kept.with_suffix(".html")
    json_out = json_out or kept
    outputs = {json_out: DIAGNOSIS, page_file: HTML, model_out: MODEL, protocol_out: PROTOCOL}
    for output, kind in outputs.items():
        check_output(output, kind)
    looks = Ledger(ledger or default_ledger())
    with engine(workers, scheduler) as executor:
        asked = subject(path, model, balance, format_, machine, skip_bad)
        say_left_out(path, asked.campaign)
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
    said = (*sentences(done.diagnosis), *done.diagnosis.notes, *written)
    present(json_, done.diagnosis.to_json(), *said)


def _with_models(
    done: "Answer", model_out: Path, path: Path, machine: Path | None
) -> "tuple[Answer, list[str]]":
    """Write the models; return the diagnosis with their errors as they run live, and the lines."""
    from estimation import model_file
    from rig.cli.extras import as_typed
    from rig.diagnosis.traces import with_cost_of_causal_filters, written_models

    done = with_cost_of_causal_filters(done)
    model_file.write_all(written_models(done), model_out)
    # a model in use is one of a configured rig, which a machine of a file alone has not
    use = ["rig", "model", "use", str(model_out)]
    if machine is not None:
        use = ["rig", "replay", str(path), "--machine", str(machine), "--model", str(model_out)]
    return done, [f"Model: {model_out}", f"To estimate with it: {as_typed(use)}"]


def _kept_with(path: Path) -> Path | None:
    """Return the file of a campaign's diagnosis in its folder; None where it cannot be kept."""
    from estimation.file_kinds import DIAGNOSIS as KIND
    from estimation.file_kinds import HTML
    from rig.campaigns.index import DIAGNOSIS
    from rig.output.console import remarks

    if not path.is_dir() or not any(path.glob("*.mcap")):
        return None
    kept = path / DIAGNOSIS
    try:
        check_output(kept, KIND)
        check_output(kept.with_suffix(".html"), HTML)
    except OutputError as error:
        remarks().print(f"The page is not kept with the recordings: {error}")
        return None
    return kept


def _plan(
    path: Path, model: Path | None, balance: str | None, machine: Path | None, json_: bool
) -> None:
    from rig.diagnosis.plan import plan_of, sentences
    from rig.output.console import progress

    with progress() as bar:
        task = bar.add_task("effects")

        def count(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        found = plan_of(path, model, balance, machine, count)
    present(json_, found.to_json(), *sentences(found))
