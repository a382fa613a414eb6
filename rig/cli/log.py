"""`rig log`: what is in a log, is it whole, repair it, export it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rig.cli.help import GroupedHelp
from rig.cli.log_export import export
from rig.output.console import JsonFlag, emit_json, remarks, results

if TYPE_CHECKING:
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
AnyRecording = Annotated[
    Path, typer.Argument(help="A log, a folder of logs, or recordings of any format.")
]
OneLog = Annotated[Path, typer.Argument(help="A log.")]


@log_app.command()
def info(path: AnyRecording, json: JsonFlag = False) -> None:
    """Show what a log lost, then run, conditions, streams, rates, marks and attachments.

    Of recordings of another format: a line for each run.
    """
    from rig.cli.log_runs import is_of_another_format, show_runs
    from rig.log.check import logs_in
    from rig.log.reader import read_log

    if is_of_another_format(path) or (path.is_dir() and not logs_in(path)):
        show_runs(path, json)
        return
    heads, foreign = _heads(path)
    found = [_described(read_log(head.path, tolerant=True)) for head in heads]
    for said in foreign:
        remarks().print(said)
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
    from rig.log.attempts import standing
    from rig.log.check import check_log

    heads, foreign = _heads(path)
    counted = [log.path for log in standing(heads)]
    superseded = [log.path for log in heads if log.path not in counted]
    reports = [check_log(item) for item in counted]
    missing = _missing_runs(path, {report.run for report in reports})
    code = max((report.verdict.exit_code for report in reports), default=ExitCode.OK)
    code = max(code, ExitCode.FAILED if missing else ExitCode.OK)
    code = max(code, ExitCode.DATA if foreign else ExitCode.OK)
    if json:
        found = {"logs": reports, "superseded": superseded, "missing_runs": missing}
        found["no_logs"] = foreign
        emit_json(found | {"exit_code": int(code)})
        return int(code)
    for report in reports:
        _show_report(report)
    screen = results(json=False)
    for said in foreign:
        screen.print(f"no log      {said}")
    for item in superseded:
        screen.print(f"superseded  {item}: not counted")
    for name in missing:
        screen.print(f"missing     {name}. Record it: rig record --resume {path}")
    screen.print(_summed_up(reports, len(superseded), len(missing)))
    return int(code)


def _heads(path: Path) -> "tuple[list[LogFile], list[str]]":
    """Return the heads of the logs at a path, and the files of a folder that are no logs."""
    from rig.log.attempts import heads_of
    from rig.log.scan import NotALogError

    heads, foreign = [], []
    for item in _logs(path):
        try:
            heads += heads_of([item])
        except NotALogError as error:
            if item == path:
                raise
            foreign.append(error.what)
    return heads, foreign


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


log_app.command()(export)


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

    from rig.output.table import listed

    screen = results(json=False)
    run, end = log["run"], log["end"]
    screen.print(f"{log['path']}: {'; '.join(log['problems']) or 'complete, nothing lost'}")
    screen.print(f"  {log['bytes'] / 1e6:.2f} MB, written by {log['written_by']}")
    if run is not None:
        conditions = listed(run.conditions) or "-"
        screen.print(f"  run {run.name} of {run.rig or 'an unnamed rig'}: {conditions}")
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
