"""`rig demo`: the whole way from bytes to a diagnosis, on the simulated rig."""

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.output.console import JsonFlag, emit_json, progress, remarks, results

if TYPE_CHECKING:
    from rig.cli.demonstration import Demo


def demo(
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder of all output.")] = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of noise and split; from the clock by default.")
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Record the simulated rig with an unmodelled effect, identify it, and confirm it."""
    from rig.cli.demonstration import PROTOCOL, run_demo
    from rig.protocols.protocol import load_protocol

    now = datetime.now()
    chosen = seed if seed is not None else int(now.timestamp()) % 1000
    folder = out or Path("logs") / f"demo-{now:%Y-%m-%d-%H%M%S}"
    remarks().print(f"rig demo, seed {chosen}: everything goes to {folder}")
    total = sum(plan.target_angle_rad.size for plan in load_protocol(PROTOCOL).plans())
    with progress() as bar:
        task = bar.add_task("samples", total=total)
        done: dict[str, int] = {}

        def count(name: str, samples: int, expected: int) -> None:
            done[name] = samples
            bar.update(task, completed=sum(done.values()), description=name)

        result = run_demo(folder, chosen, lambda text: bar.console.print(f"- {text}"), count)
    shown = results(json)
    for line in _told(result):
        shown.print(line)
    if json:
        emit_json(result.to_json())


def _told(result: "Demo") -> list[str]:
    """Return the findings, their files and the next command."""
    from rig.reports.diagnosis_words import sentences

    lines = [f"{len(result.runs)} runs, {sum(r.samples for r in result.runs)} samples."]
    if not result.firmware:
        lines.append(
            "The simulated board was the plain one. The compiled firmware takes its place in a"
            " checkout of the sources, after make -C firmware."
        )
    logs = result.folder / "logs"
    return [
        *lines,
        "",
        *sentences(result.diagnosis),
        "",
        f"Report: {result.report}",
        "",
        "This was one equation. With all four the same test runs are used again, so the result is",
        "marked as exploratory:",
        f"  rig diagnose {logs} --ledger {result.ledger}",
        "The model with the identified effect, as it runs:",
        f"  rig replay {logs} --model {result.model}",
        "The recordings in a browser:",
        f"  rig view {logs}",
        "To choose and record further experiments automatically, until the effect is unique:",
        "  rig loop --sim",
        "Open the page:",
        f"  rig campaigns --open --root {result.folder}",
    ]
