"""`rig calibrate check`: may the active calibrations be used, and do recordings agree with them?"""

from datetime import UTC, datetime
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from rig.cli.calibrate_store import StoreOption, store_of
from rig.cli.options import ConfigOption, FormatOption, SimFlag, complete_recordings, say_left_out
from rig.output.console import JsonFlag, present
from rig.output.table import counted

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from calibration.agreement import Agreement
    from calibration.record import CalibrationRecord
    from calibration.scales import Scale
    from estimation.campaign import Run
    from rig.calibrate.zeros import ZeroMotion


def check(
    path: Annotated[
        Path | None,
        Argument(
            help="Recordings to compare: a file, folder or archive. If none: the active records.",
            autocompletion=complete_recordings,
        ),
    ] = None,
    format_: FormatOption = None,
    config: ConfigOption = None,
    sim: SimFlag = False,
    log: Annotated[
        Path | None,
        Option(help="Of the active records: also their ranges against this log's counts."),
    ] = None,
    store: StoreOption = None,
    json: JsonFlag = False,
) -> int:
    """Check the active records, or verify the calibrations of sensors on recordings; nothing moves.

    The active records are checked against today's date, serial numbers and raw files. On recordings
    the spindle's encoder is compared with the motor's (scale and offset), the torque sensors at
    both ends with each other, and motor current and spindle torque with the rig's calibrated
    constant, the scatter over runs as uncertainty. Of every sensor that is tared: how far its zero
    moved. Exit code 1 when one is off, or must not be used. Friction bounds how closely torques
    compare; for more, weights are needed: rig calibrate torque.
    """
    if path is None:
        return _check_records(config, sim, log, store, json)
    from calibration.agreement import NoPairError, agreements
    from rig.calibrate.zeros import zero_motions
    from rig.importers.registry import open_campaign
    from rig.log.reader import read_head

    campaign = open_campaign(path, format_)
    say_left_out(path, campaign)
    kept = campaign.evidence.runs
    logs = [run.source for run in kept if run.source and run.source.suffix == ".mcap"]
    zeros = zero_motions(list(map(read_head, logs)))
    try:
        found = agreements(handle.recording() for handle in kept)
    except NoPairError:
        if not zeros:
            raise
        found = []
    scales, unchecked = _scales(kept, _record(kept, config, sim))
    lines = [line for one in found for line in lines_of(one)]
    lines += [line for one in scales for line in scale_lines(one)]
    wrong = [one.encoder for one in found if one.scale_is_wrong or one.offset_is_wrong]
    wrong += [one.channel for one in scales if one.is_wrong]
    wrong += [one.channel for one in zeros if one.is_wrong]
    data = {"agreements": found, "scales": scales, "zeros": zeros, "wrong": wrong}
    present(json, data, *lines, *unchecked, *map(zero_line, zeros))
    return 1 if wrong else 0


def _check_records(
    config: Path | None, sim: bool, log: Path | None, store: Path | None, json: bool
) -> int:
    from calibration.rules import judge, judge_range, judge_raw
    from rig.configuration.chosen import choose_rig
    from rig.log.reader import read_log
    from rig.log.streams import COUNTS

    settings = choose_rig(config, sim)
    kept = store_of(store, settings)
    now = datetime.now(UTC)
    here = ("", settings.instrument.serial)
    active = [record for record in kept.active().values() if record.instrument in here]
    verdicts = [
        v for record in active for v in (*judge(record, now, settings.serials), *judge_raw(record))
    ]
    if log is not None:
        counts = read_log(log, topics=(COUNTS,)).topics[COUNTS]
        read = [record for record in active if record.input in counts.columns]
        verdicts += [v for record in read for v in judge_range(record, counts.rows[record.input])]
    said = [
        f"{'error' if v.is_error else 'warning'}: {v.channel} {v.record}: {v.message} ({v.rule})"
        for v in verdicts
    ]
    fault = f"{len(verdicts)} objections, listed above" if verdicts else "nothing against them"
    bad = any(v.is_error for v in verdicts)
    data = {"store": kept.folder, "ok": not bad, "verdicts": verdicts}
    present(json, data, *said, f"Active records: {len(active)}; {fault}.")
    return int(bad)


def _record(runs: "Sequence[Run]", config: Path | None, sim: bool) -> "CalibrationRecord | None":
    """Return the active calibration of the current for the recordings' instrument."""
    from rig.configuration.chosen import choose_rig, default_config

    if not runs or (config is None and not sim and default_config() is None):
        return None
    serial = runs[0].recording().instrument.serial
    active = choose_rig(config, sim).default_store.active()
    keys = [("current", "spindle_torque_n_m", instrument) for instrument in (serial, "")]
    return next((active[key] for key in keys if key in active), None)


def _scales(
    runs: "Sequence[Run]", record: "CalibrationRecord | None"
) -> "tuple[list[Scale], list[str]]":
    """Return the scales that the runs allow to check, and why the others cannot be."""
    from calibration.quality import BadDataError
    from calibration.scales import current_scale, torque_scale

    recordings = [run.recording() for run in runs]
    found: list[Scale] = []
    unchecked = []
    checks: dict[str, Callable[[], Scale]] = {
        "the torque sensors' scale": lambda: torque_scale(recordings),
        "motor current against torque": lambda: current_scale(recordings, record),
    }
    for name, check in checks.items():
        try:
            found.append(check())
        except BadDataError as error:
            unchecked.append(f"not checked: {name}. {error.what}")
    return found, unchecked


def scale_lines(one: "Scale") -> list[str]:
    """Return the scale of one sensor against another in words."""
    word = "ALARM" if one.is_wrong else "noted" if one.expected is None else "good"
    middle, half = (one.low + one.high) / 2, (one.high - one.low) / 2
    head = f"{word}: {one.channel} against {one.reference}, {one.runs} runs:"
    if not one.unit:  # a ratio of two torques
        lines = [
            f"{head} scale between {one.low:.3f} and {one.high:.3f} (95 %; friction may be any);"
            f" 1 by {one.source}."
        ]
        help_ = (
            "A torque sensor or the jaw's encoder is off: weights show which, rig calibrate torque"
        )
    else:
        expected = "no calibrated constant: rig calibrate current"
        if one.expected is not None:
            expected = f"{one.expected:.3f} {one.unit} by {one.source}"
        lines = [f"{head} {middle:.3f} +- {half:.3f} {one.unit} (95 %); {expected}."]
        help_ = "Sensor of current, sensor of torque or gear changed: rig calibrate torque, current"
    return [*lines, f"  {help_}"] if one.is_wrong else lines


def zero_line(one: "ZeroMotion") -> str:
    """Return the motion of a zero in words."""
    from rig.calibrate.shown import with_unit

    word = "ALARM" if one.is_wrong else "noted" if one.limit is None else "good"
    limit = "no limit" if one.limit is None else f"limit {with_unit(one.limit, one.unit)}"
    return (
        f"{word}: zero of {one.channel}, {counted(one.runs, 'run')}: moved by at most"
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
