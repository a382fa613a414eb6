"""The simulated rig compared with a measured run of the same trajectory and load.

python -m rig.cli.compare --data Tool_4_Maryland_L_4.tar.xz --run 24
"""

import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.errors import UsageError
from rig.output.console import JsonFlag, emit_json, results


def main(
    data: Annotated[Path, typer.Option(help="Folder, file or archive of the reference rig.")],
    run: Annotated[str, typer.Option(help="Name of the run.")] = "24",
    figure: Annotated[Path | None, typer.Option(help="Also write a figure here (PNG).")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Print the levels of a measured run and of its simulation."""
    from rig.importers.registry import open_campaign
    from rig.simulation.compare import compare, draw_figure

    chosen = [handle for handle in open_campaign(data).runs if handle.name == run]
    if not chosen:
        raise UsageError(f"{data} has no run {run!r}.", fix="Name a run of that campaign.")
    recording = chosen[0].recording()
    rows = compare(recording)
    if figure is not None:
        draw_figure(recording, figure)
    if as_json:
        emit_json({"run": recording.name, "rows": rows, "figure": figure})
        return
    out = results(json=False)
    out.print(f"{'channel':24s}{'measured 5 / 50 / 95 %':>30s}{'simulated 5 / 50 / 95 %':>30s}")
    for row in rows:
        levels = [
            f"{s.low:9.4f} {s.middle:9.4f} {s.high:9.4f}" for s in (row.measured, row.simulated)
        ]
        out.print(f"{row.channel:24s}{levels[0]:>30s}{levels[1]:>30s}")


if __name__ == "__main__":
    from rig.cli.main import app
    from rig.cli.main import main as command_line

    # as a verb of `rig`, for its errors and exit codes
    app.command("compare")(main)
    sys.exit(command_line(["compare", *sys.argv[1:]]))
