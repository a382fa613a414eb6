"""`rig diagnose`: what does the declared model lack?"""

from pathlib import Path
from typing import Annotated

import typer

from rig.output.console import emit_json, plain, remarks, results


def diagnose(
    path: Annotated[Path, typer.Argument(help="Recordings: a file, folder or archive.")],
    model: Annotated[
        Path | None,
        typer.Option("--model", "-m", help="Declared model: a file, or a shipped one by name."),
    ] = None,
    balance: Annotated[str | None, typer.Option(help="Only this equation, such as motor.")] = None,
    json_: Annotated[
        Path | None, typer.Option("--json", help="File of the diagnosis; - is stdout.")
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Folder of the HTML report.")] = None,
    model_out: Annotated[
        Path | None, typer.Option(help="File of the models with the identified effects.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the split and of everything random.")] = 0,
    workers: Annotated[int, typer.Option(help="Number of processes; 1 is this one.")] = 1,
    quick: Annotated[
        bool, typer.Option("--quick", help="A first answer in seconds, without simulated nulls.")
    ] = False,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Address of a Dask scheduler."),
    ] = None,
    protocol_out: Annotated[
        Path | None, typer.Option(help="Protocol file of the next experiment.")
    ] = None,
    ledger: Annotated[
        Path | None, typer.Option(help="Path of the held-out-data usage log.")
    ] = None,
    format_: Annotated[
        str | None, typer.Option("--format", help="Format of the recordings; detected by default.")
    ] = None,
) -> None:
    """Identify the effect that the declared model lacks, and confirm it on held-out test runs."""
    import json

    from estimation import model_file
    from estimation.files import write_text_atomic
    from rig.diagnosis.engine import engine
    from rig.diagnosis.ledger import Ledger, default_ledger
    from rig.diagnosis.propose import write_protocol
    from rig.diagnosis.run import run_diagnosis
    from rig.diagnosis.subject import subject
    from rig.diagnosis.written import with_cost_of_causal_filters, written_models
    from rig.output.provenance import Provenance
    from rig.output.render import write_report
    from rig.reports.diagnosis import page
    from rig.reports.diagnosis_words import sentences

    working = remarks()
    with engine(workers, scheduler) as executor:
        asked = subject(path, model, balance, format_)
        done = run_diagnosis(
            asked.campaign,
            asked.models,
            Ledger(ledger or default_ledger()),
            seed=seed,
            executor=executor,
            quick=quick,
            on_stage=lambda what: working.print(f"{what} ..."),
        )
    if model_out is not None:
        done = with_cost_of_causal_filters(done)
    screen = results(json_ == Path("-"))
    for line in sentences(done.diagnosis):
        screen.print(line, markup=False)
    for note in done.diagnosis.notes:
        screen.print(note, markup=False)
    if model_out is not None:
        model_file.write_all(written_models(done), model_out)
        screen.print(f"Model: {model_out}", markup=False)
    if report is not None:
        where = write_report(report / "diagnosis.html", page(done, Provenance.now(seed)))
        screen.print(f"Report: {where}", markup=False)
    if protocol_out is not None:
        screen.print(write_protocol(done.diagnosis, protocol_out), markup=False)
    if json_ == Path("-"):
        emit_json(done.diagnosis.to_json())
    elif json_ is not None:
        text = json.dumps(plain(done.diagnosis.to_json()), indent=2, allow_nan=False)
        write_text_atomic(json_, text + "\n")
        screen.print(f"Diagnosis: {json_}", markup=False)
