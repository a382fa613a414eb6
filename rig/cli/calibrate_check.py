"""`rig calibrate check`: do recordings that exist agree with the calibrations of the sensors?"""

from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.shipped import complete_recordings
from rig.output.console import JsonFlag, emit_json, results

if TYPE_CHECKING:
    from calibration.agreement import Agreement
    from rig.calibrate.zeros import ZeroMotion


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
    """Verify the calibrations of sensors on recordings that exist; nothing moves.

    Compares the spindle's encoder with the motor's: scale and offset, with the scatter over runs as
    uncertainty. Of every sensor that is tared: how far its zero moved. Exit code 1 when one is off.
    The scale of a torque or current sensor needs weights: rig calibrate.
    """
    from calibration.agreement import NoPairError, agreements
    from rig.calibrate.zeros import zero_motions
    from rig.cli.left_out import say_left_out
    from rig.importers.registry import open_campaign
    from rig.log.attempts import heads_of

    campaign = open_campaign(path, format_)
    say_left_out(path, campaign)
    kept = campaign.evidence.runs
    logs = [run.source for run in kept if run.source and run.source.suffix == ".mcap"]
    zeros = zero_motions(heads_of(logs))
    try:
        found = agreements(handle.recording() for handle in kept)
    except NoPairError:
        if not zeros:
            raise
        found = []
    screen = results(json)
    for line in (*(line for one in found for line in lines_of(one)), *map(zero_line, zeros)):
        screen.print(line, markup=False)
    wrong = [one.encoder for one in found if one.scale_is_wrong or one.offset_is_wrong]
    wrong += [one.channel for one in zeros if one.is_wrong]
    if json:
        emit_json({"agreements": found, "zeros": zeros, "wrong": wrong})
    return 1 if wrong else 0


def zero_line(one: "ZeroMotion") -> str:
    """Return the motion of a zero in words."""
    from rig.calibrate.shown import with_unit

    word = "ALARM" if one.is_wrong else "noted" if one.limit is None else "good"
    limit = "no limit" if one.limit is None else f"limit {with_unit(one.limit, one.unit)}"
    return (
        f"{word}: zero of {one.channel}, {one.runs} runs: moved by at most"
        f" {with_unit(one.within_run, one.unit)} within a run ({limit}), by"
        f" {with_unit(one.over_all, one.unit)} over all runs."
    )


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
