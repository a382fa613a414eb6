"""`rig calibrate check`: do the encoders of recordings that exist agree with each other?"""

from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.shipped import complete_recordings
from rig.output.console import JsonFlag, emit_json, results

if TYPE_CHECKING:
    from calibration.agreement import Agreement


def check(
    path: Annotated[
        Path,
        typer.Argument(
            help="Recordings: a file, folder or archive.", autocompletion=complete_recordings
        ),
    ],
    format_: Annotated[
        str | None, typer.Option("--format", help="Format of the recordings; detected by default.")
    ] = None,
    json: JsonFlag = False,
) -> int:
    """Verify the encoders' calibrations on recordings that exist; nothing moves.

    Compares each encoder with the one before it: scale and offset, with the scatter over runs as
    uncertainty. Exit code 1 when one is off.
    """
    from calibration.agreement import agreements
    from rig.cli.left_out import say_left_out
    from rig.importers.registry import open_campaign

    campaign = open_campaign(path, format_)
    say_left_out(path, campaign)
    found = agreements(handle.recording() for handle in campaign.runs if not handle.excluded)
    screen = results(json)
    for one in found:
        for line in lines_of(one):
            screen.print(line, markup=False)
    wrong = [one.encoder for one in found if one.scale_is_wrong or one.offset_is_wrong]
    if json:
        emit_json({"agreements": found, "wrong": wrong})
    return 1 if wrong else 0


def lines_of(one: "Agreement") -> list[str]:
    """Return an agreement in words."""
    offset, spread = degrees(one.offset_rad), degrees(one.offset_uncertainty_rad)
    word = "ALARM" if one.scale_is_wrong or one.offset_is_wrong else "good"
    lines = [
        f"{word}: {one.channel} against {one.reference}, {one.runs} runs: scale {one.scale:.4f} +-"
        f" {one.scale_uncertainty:.4f}, offset {offset:.2f} +- {spread:.2f} deg; twist and lost"
        f" motion within a run: {degrees(one.within_run_rad):.2f} deg."
    ]
    if one.offset_is_wrong:
        lines.append(
            f"  The zero of one of the two is {abs(offset):.1f} deg off. Reference the rig again"
            f" (rig reference), or calibrate: rig calibrate encoder --which {one.encoder}"
        )
    if one.scale_is_wrong:
        lines.append(
            f"  The scale is {abs(one.scale - 1):.2%} off: check counts per turn and gear ratio,"
            f" then rig calibrate encoder --which {one.encoder}"
        )
    return lines
