"""`rig loop`: record, diagnose, take the next experiment, until the name is unique."""

from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from rig.output.console import JsonFlag, emit_json, progress, remarks, results


def loop(
    sim: Annotated[
        bool, typer.Option("--sim", help="Use the simulated rig; no other rig is moved.")
    ] = False,
    hide: Annotated[
        list[str] | None,
        typer.Option(
            help="Hidden effect, or effect=strength; by default drawn by the seed; `none` for none."
        ),
    ] = None,
    balance: Annotated[str | None, typer.Option(help="Only this equation, such as motor.")] = None,
    protocol: Annotated[
        str | None, typer.Option("--protocol", "-p", help="First protocol; by default `diagnosis`.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder of all output.")] = None,
    rounds: Annotated[int, typer.Option(help="Maximum number of campaigns.")] = 3,
    minutes: Annotated[float, typer.Option(help="No round starts after this time, min.")] = 20.0,
    seed: Annotated[
        int | None, typer.Option(help="Random seed; taken from the clock by default.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Propose no next experiment.")] = False,
    workers: Annotated[int, typer.Option(help="Number of processes; 1 is this one.")] = 1,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler.")] = None,
    json: JsonFlag = False,
) -> None:
    """Record, diagnose and choose the next experiment, until the effect is unique.

    Ends when every effect is unique, when the model is complete, or at the limit of rounds or time.
    """
    from rig.configuration.config import load_config
    from rig.diagnosis.engine import engine
    from rig.diagnosis.loop import Budget, Round, run_loop
    from rig.diagnosis.subject import declared_models
    from rig.diagnosis.traces import traces
    from rig.errors import UsageError
    from rig.output.provenance import Provenance
    from rig.output.render import write_report
    from rig.protocols.protocol import load_protocol
    from rig.reports.diagnosis import page
    from rig.reports.diagnosis_words import next_sentence, sentences
    from rig.simulation.hidden import chosen

    if not sim:
        raise UsageError("The loop moves the simulated rig only.", fix="Type `rig loop --sim`.")
    screen = results(json)
    now = datetime.now()
    number = seed if seed is not None else int(now.timestamp()) % 1000
    hidden = chosen(hide, number)
    settings = load_config().changed(
        simulation={"seed": number, "hidden": hidden, "plant": "declared"}
    )
    folder = out or Path("logs") / f"loop-{now:%Y-%m-%d-%H%M%S}"
    remarks().print(f"rig loop, seed {number}: everything goes to {folder}", markup=False)
    first = load_protocol(protocol) if protocol else None
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
            first=first,
            seed=number,
            executor=executor,
            quick=quick,
            on_stage=lambda text: bar.console.print(f"- {text}", markup=False),
            on_progress=count,
        ):
            made.append(one)
            bar.stop()
            for line in sentences(one.done.diagnosis):
                screen.print(line, markup=False)
            report = folder / f"round-{one.number}"
            text = page(one.done.diagnosis, traces(one.done.answer), Provenance.now(number))
            where = write_report(report / "diagnosis.html", text)
            screen.print(f"Report: {where}", markup=False)
            screen.print(one.stopped or next_sentence(one.done.diagnosis), markup=False)
            bar.start()
    told = ", ".join(f"{name} ({strength:g})" for name, strength in hidden.items())
    screen.print(f"Hidden effects: {told or 'none'}.", markup=False)
    if json:
        last = made[-1]
        emit_json(
            {
                "folder": folder,
                "hidden": hidden,
                "stopped": last.stopped,
                "rounds": [one.to_json() for one in made],
            }
        )
