"""`rig log`: what is in a log, is it whole, repair it, export it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rig.cli.help import GroupedHelp
from rig.output.console import JsonFlag, emit_json, remarks, results

if TYPE_CHECKING:
    from calibration.linear import CalibrationSet
    from rig.log.check import LogReport
    from rig.log.reader import LogFile
    from rig.log.repair import RepairReport

log_app = typer.Typer(
    name="log",
    help="Inspect, check, repair and export logs.",
    cls=GroupedHelp,
    no_args_is_help=True,
    rich_markup_mode=None,
)

LogOrFolder = Annotated[Path, typer.Argument(help="A log, or a folder of logs.")]
OneLog = Annotated[Path, typer.Argument(help="A log.")]


@log_app.command()
def info(path: LogOrFolder, json: JsonFlag = False) -> None:
    """Show what a log lost, then run, conditions, streams, rates, marks and attachments."""
    from rig.log.reader import read_log

    found = [_described(read_log(item, tolerant=True)) for item in _logs(path)]
    if json:
        emit_json({"logs": found})
        return
    if len(found) > 1:
        lossy = [log for log in found if log["problems"]]
        results(json).print(
            f"{len(found)} logs, {len(lossy)} of them not complete."
            if lossy
            else f"{len(found)} logs, nothing lost."
        )
    for log in found:
        _show_info(log)


@log_app.command()
def check(path: LogOrFolder, json: JsonFlag = False) -> int:
    """Count samples expected and received, list every gap, and sum up in a line.

    A campaign is complete when every run of its protocol is. Earlier attempts of a run that was
    recorded again, and logs that were repaired, are listed and not counted. Exit code 0 if
    complete, 1 if samples or runs are missing, 5 if a file is damaged.
    """
    from rig.errors import ExitCode
    from rig.log.attempts import heads_of, standing
    from rig.log.check import check_log

    heads = heads_of(_logs(path))
    counted = [log.path for log in standing(heads)]
    superseded = [log.path for log in heads if log.path not in counted]
    reports = [check_log(item) for item in counted]
    missing = _missing_runs(path, {report.run for report in reports})
    code = max((report.verdict.exit_code for report in reports), default=ExitCode.OK)
    code = max(code, ExitCode.FAILED if missing else ExitCode.OK)
    if json:
        found = {"logs": reports, "superseded": superseded, "missing_runs": missing}
        emit_json(found | {"exit_code": int(code)})
        return int(code)
    for report in reports:
        _show_report(report)
    screen = results(json=False)
    for item in superseded:
        screen.print(f"superseded  {item}: not counted")
    for name in missing:
        screen.print(f"missing     {name}. Record it: rig record --resume {path}")
    screen.print(_summed_up(reports, len(superseded), len(missing)))
    return int(code)


def _missing_runs(path: Path, there: set[str | None]) -> list[str]:
    """Return the runs of a campaign's protocol that have no log; empty if it is not a campaign."""
    from rig.recording.campaign import MANIFEST, read_manifest

    if not (path / MANIFEST).is_file():
        return []
    protocol, _ = read_manifest(path)
    return [plan.name for plan in protocol.any_plans() if plan.name not in there]


def _summed_up(reports: "list[LogReport]", superseded: int, missing: int) -> str:
    """Return the line that sums up a check."""
    from rig.log.check import Verdict

    whole = sum(report.verdict is Verdict.COMPLETE for report in reports)
    received = sum(topic.received for report in reports for topic in report.topics)
    expected = sum(topic.expected for report in reports for topic in report.topics)
    line = f"{whole} of {len(reports) + missing} runs complete, {received} of {expected} samples"
    if superseded:
        line += f"; {superseded} superseded {'log' if superseded == 1 else 'logs'} not counted"
    return f"{line}."


@log_app.command()
def repair(
    path: OneLog,
    out: Annotated[
        Path | None, typer.Option(help="File to write; NAME.repaired.mcap by default.")
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Write the readable part of a damaged log to a new file; the original is not changed."""
    from rig.log.repair import repair_log

    report = repair_log(path, out)
    if json:
        emit_json(report)
    else:
        _show_repair(report)


@log_app.command()
def export(
    path: Annotated[
        Path, typer.Argument(help="A log; or a folder, for one table of all its runs.")
    ],
    format_name: Annotated[
        str, typer.Option("--format", help="csv or parquet; of a single log npz, too.")
    ] = "csv",
    topic: Annotated[str | None, typer.Option(help="Only this topic.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="File with --topic, else folder; by default by the log.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite files.")] = False,
    calibration: Annotated[
        str | None,
        typer.Option(help="Apply this set instead: a TOML file, or a shipped set's name."),
    ] = None,
    record: Annotated[
        list[str] | None,
        typer.Option(help="Apply this record of the store, by hash; may be repeated."),
    ] = None,
    store: Annotated[Path | None, typer.Option(help="Folder of the store of --record.")] = None,
    json: JsonFlag = False,
) -> None:
    """Export a log, one file for each topic; or a campaign as one table.

    The table of a campaign (a folder or an archive of any format that is known) has a row a sample,
    with its run and conditions. Parquet holds units, instrument, calibrations and notes as
    metadata; for a CSV they are written to NAME.csv.json.
    """
    from rig.errors import UsageError
    from rig.log.export import ExportFormat, export_log

    if path.is_dir() or not path.name.endswith((".mcap", ".part")):
        if topic or calibration or record:
            raise UsageError("--topic, --calibration and --record are of a single log.")
        _export_campaign(path, format_name, out, force, json)
        return
    known = [item.value for item in ExportFormat]
    if format_name not in known:
        raise UsageError(
            f"There is no format {format_name!r}.", fix=f"Choose one of {', '.join(known)}."
        )
    applied = _other_calibrations(path, calibration, record or [], store)
    written = export_log(
        path, ExportFormat(format_name), out, topic, force=force, calibrations=applied
    )
    if json:
        names = None if applied is None else {applied.name: applied.content_hash}
        emit_json({"written": written, "calibrations": names})
    else:
        for target in written:
            results(json).print(f"wrote {target}")


def _export_campaign(
    path: Path, format_name: str, out: Path | None, force: bool, json: bool
) -> None:
    """Write all runs at a path as one table."""
    from rig.cli.left_out import say_left_out
    from rig.errors import UsageError
    from rig.importers.registry import open_campaign
    from rig.importers.tidy import TidyFormat, write_tidy

    known = [item.value for item in TidyFormat]
    if format_name not in known:
        raise UsageError(
            f"A campaign is not exported as {format_name!r}.",
            fix=f"Choose one of {', '.join(known)}.",
        )
    campaign = open_campaign(path)
    say_left_out(path, campaign)
    if out is not None and out.is_dir():
        out = out / f"{path.resolve().name}.{format_name}"
    target = out or path.resolve().with_name(f"{path.resolve().name}.{format_name}")
    written = write_tidy(campaign, target, TidyFormat(format_name), force)
    if json:
        emit_json({"written": [written], "runs": campaign.evidence.names})
    else:
        results(json).print(f"wrote {written}: {len(campaign.evidence)} runs")


def _other_calibrations(
    path: Path, calibration: str | None, records: list[str], store: Path | None
) -> "CalibrationSet | None":
    """Return the set an export is to be made with; None for the one it was recorded with.

    If the log exceeds the range of a record, the rules apply: a remark, or an error.
    """
    if calibration is None and not records:
        return None
    from calibration.linear import load_calibration_set, shipped_calibration_set
    from calibration.rules import judge_range, refuse_errors
    from calibration.store import CalibrationStore, compose, default_folder
    from rig.log.reader import read_log
    from rig.log.recalibrate import carried_calibrations
    from rig.log.streams import COUNTS

    log = read_log(path, topics=(COUNTS,))
    if calibration is None:
        base = carried_calibrations(log)
    elif calibration.endswith(".toml"):
        base = load_calibration_set(Path(calibration))
    else:
        base = shipped_calibration_set(calibration)
    kept = CalibrationStore(store or default_folder())
    found = [kept.get(start) for start in records]
    made = compose(base, found)
    if COUNTS in log.topics:
        rows = log.topics[COUNTS].rows
        verdicts = [v for r in found for v in judge_range(r, rows[r.input])]
        for verdict in refuse_errors(verdicts):
            remarks().print(f"{verdict.channel}: {verdict.message}", markup=False)
    return made


def _logs(path: Path) -> list[Path]:
    """Return the logs at a path, at least one."""
    from rig.errors import UsageError
    from rig.log.check import logs_in

    found = logs_in(path)
    if not found:
        raise UsageError(f"There is no log in {path}.", fix="Name a file or another folder.")
    return found


def _described(log: "LogFile") -> dict[str, Any]:
    """Return the result of `info` for a log."""
    from rig.log.check import report_on, stream_time_s
    from rig.log.convert import exclusion

    report = report_on(log)
    topics = []
    for name, topic in log.topics.items():
        time_s = stream_time_s(topic)
        duration_s = float(time_s[-1] - time_s[0]) if len(topic) > 1 else 0.0
        topics.append(
            {
                "topic": name,
                "messages": len(topic),
                "duration_s": duration_s,
                "rate_hz": (len(topic) - 1) / duration_s if duration_s > 0 else None,
                "expected_rate_hz": topic.stream.rate_hz,
                "fields": {field.name: field.unit for field in topic.stream.fields},
            }
        )
    return {
        "path": log.path,
        "bytes": log.path.stat().st_size,
        "written_by": log.library,
        "run": log.run,
        "end": log.end,
        "topics": topics,
        "unread_topics": log.unread,
        "marks": log.marks,
        "stretches": log.stretches,
        "attachments": {item.name: len(item.data) for item in log.attachments},
        "excluded": exclusion(log),
        "damaged": bool(log.damage),
        "lost": {t.topic: t.expected - t.received for t in report.topics},
        "problems": report.problems,
    }


def _show_info(log: dict[str, Any]) -> None:
    from rich.table import Table

    screen = results(json=False)
    run, end = log["run"], log["end"]
    screen.print(f"{log['path']}: {'; '.join(log['problems']) or 'complete, nothing lost'}")
    screen.print(f"  {log['bytes'] / 1e6:.2f} MB, written by {log['written_by']}")
    if run is not None:
        conditions = ", ".join(f"{name} = {value}" for name, value in run.conditions.items())
        screen.print(f"  run {run.name} of {run.rig or 'an unnamed rig'}: {conditions or '-'}")
        screen.print(f"  started {_date(run.started_at_ns)}; notes: {run.notes or '-'}")
        excluded = log["excluded"]
        screen.print(f"  excluded: {excluded}" if excluded else "  counts as evidence")
    state = "not closed" if end is None else "clean" if end.clean else f"not clean: {end.reason}"
    screen.print(f"  end {state}{'; the file is damaged' if log['damaged'] else ''}")
    table = Table(box=None, pad_edge=True)
    for heading in ("topic", "messages", "s", "Hz", "fields"):
        table.add_column(heading, justify="left" if heading in ("topic", "fields") else "right")
    for topic in log["topics"]:
        rate = f"{topic['rate_hz']:.2f}" if topic["rate_hz"] else "-"
        fields = ", ".join(topic["fields"])
        messages, duration = str(topic["messages"]), f"{topic['duration_s']:.3f}"
        table.add_row(topic["topic"], messages, duration, rate, fields)
    screen.print(table)
    for mark in log["marks"]:
        screen.print(f"  mark at {mark.time_s:.3f} s: {mark.text}")
    for name, size in log["attachments"].items():
        screen.print(f"  attached {name}, {size} bytes")


def _date(started_at_ns: int | None) -> str:
    from datetime import UTC, datetime

    if started_at_ns is None:
        return "at an unknown time"
    return datetime.fromtimestamp(started_at_ns * 1e-9, UTC).isoformat(timespec="seconds")


def _show_report(report: "LogReport") -> None:
    screen = results(json=False)
    screen.print(f"{report.verdict.value:10}  {report.path}")
    for topic in report.topics:
        screen.print(f"  {topic.topic}: {topic.received} of {topic.expected} samples")
        for gap in topic.gaps:
            screen.print(
                f"    gap at {gap.start_s:.4f} s, {gap.length_s * 1e3:.1f} ms: {gap.samples}"
                f" samples, {gap.first_sequence} to {gap.last_sequence}"
            )
    for problem in report.problems:
        screen.print(f"  {problem}")
    for damage in report.damage:
        screen.print(f"    byte {damage.offset}, {damage.length} bytes: {damage.what}")


def _show_repair(report: "RepairReport") -> None:
    screen = results(json=False)
    if report.repaired is None:
        screen.print(f"{report.original} is not damaged; nothing was written.")
        return
    screen.print(f"wrote {report.repaired}, and read it back equal")
    for topic, count in report.recovered.items():
        unproven = report.salvaged.get(topic, 0)
        note = f", {unproven} of them from the torn end, without a checksum" if unproven else ""
        screen.print(
            f"  {topic}: {count} samples recovered{note}; {report.lost.get(topic, 0)} known lost"
        )
    screen.print(f"{report.original} is unchanged.")
