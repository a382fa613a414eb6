"""`rig demo`: the whole way from bytes to a report, on the simulated rig."""

from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.output import JsonFlag, console, emit_json, progress


def demo(
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for everything.")] = None,
    seed: Annotated[
        int | None, typer.Option(help="Draws the hidden effect; by the clock if none.")
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Record the simulated rig with an effect its model lacks, fit, and show what is left."""
    from rig.demo import PROTOCOL, run_demo
    from rig.protocol import load_protocol

    now = datetime.now()
    chosen = seed if seed is not None else int(now.timestamp()) % 1000
    folder = out or Path("logs") / f"demo-{now:%Y-%m-%d-%H%M%S}"
    screen = console()
    screen.print(f"rig demo, seed {chosen}: everything goes to {folder}", markup=False)
    total = sum(plan.target_angle_rad.size for plan in load_protocol(PROTOCOL).plans())
    with progress() as bar:
        task = bar.add_task("samples", total=total)
        done: dict[str, int] = {}

        def count(name: str, samples: int, expected: int) -> None:
            done[name] = samples
            bar.update(task, completed=sum(done.values()), description=name)

        result = run_demo(folder, chosen, lambda text: screen.print(f"- {text}"), count)
    if not result.firmware:
        screen.print("Left out: the firmware core in the loop (no C++ compiler; apt install g++).")
    screen.print(f"{len(result.runs)} runs, {sum(r.samples for r in result.runs)} samples.")
    screen.print(
        f"Declared model on runs it was not fitted on: {result.held_out.rmse * 1e3:.2f} mN m."
    )
    screen.print(result.structures[0].sentence(), markup=False)
    screen.print(f"Report: {result.report}", markup=False)
    logs = folder / "logs"
    screen.print(f"Next: rig diagnose {logs} --report {folder}", markup=False)
    screen.print(f"      rig replay {logs} --model {result.model}", markup=False)
    if json:
        emit_json(result)
