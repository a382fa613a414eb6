"""`rig loop`: record, diagnose, take the next experiment, until the name is unique."""

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from rig.cli.options import (
    EquationOption,
    QuickFlag,
    SchedulerOption,
    SimFlag,
    SimulationSeed,
    WorkersOption,
)
from rig.errors import UsageError
from rig.output.console import JsonFlag, present, progress, remarks, results

if TYPE_CHECKING:
    from rich.console import Console

    from rig.diagnosis.loop import Round


def loop(
    sim: SimFlag = False,
    hide: Annotated[
        list[str] | None,
        Option(
            help="Hidden effect, or effect=strength; by default drawn by the seed; `none` for none."
        ),
    ] = None,
    balance: EquationOption = None,
    protocol: Annotated[
        str | None, Option("--protocol", "-p", help="First protocol; by default `diagnosis`.")
    ] = None,
    out: Annotated[Path | None, Option("--out", "-o", help="Folder of all output.")] = None,
    rounds: Annotated[int, Option(help="Maximum number of campaigns.")] = 3,
    minutes: Annotated[float, Option(help="No round starts after this time, min.")] = 20.0,
    seed: SimulationSeed = None,
    quick: QuickFlag = False,
    workers: WorkersOption = 1,
    scheduler: SchedulerOption = None,
    json: JsonFlag = False,
) -> None:
    """Record, diagnose and choose the next experiment, until the effect is unique.

    Ends when every effect is unique, when the model is complete, or at the limit of rounds or time.
    """
    from rig.configuration.config import load_config
    from rig.diagnosis.loop import Budget, Round, run_loop
    from rig.diagnosis.subject import declared_models
    from rig.diagnosis.work import engine
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
