"""`rig log`: what is in a log, is it whole, repair it, export it."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from rig.cli.log_export import export
from rig.cli.options import group, say_left_out
from rig.errors import ExitCode, UsageError
from rig.output.console import JsonFlag, present, remarks
from rig.output.provenance import utc_of
from rig.output.table import counted, listed

if TYPE_CHECKING:
    from rig.log.check import LogReport, TopicReport
    from rig.log.reader import LogFile
    from rig.log.repair import RepairReport

log_app = group("log", "Inspect, check, repair and export logs.")

LogOrFolder = Annotated[Path, Argument(help="A log, or a folder of logs.")]
AnyRecording = Annotated[
    Path, Argument(help="A log, a folder of logs, or recordings of any format.")
]
OneLog = Annotated[Path, Argument(help="A log.")]


@log_app.command()
def info(path: AnyRecording, json: JsonFlag = False) -> None:
    """Show what a log lost, then run, conditions, streams, rates, marks and attachments.

    Of recordings of another format: a line for each run. Exit code 0 of a damaged log, too, which
    is described as far as it can be read; rig log check ends with 1 or 5.
    """
    from rig.log.check import logs_in
    from rig.log.reader import read_log

    if _is_of_another_format(path) or (path.is_dir() and not logs_in(path)):
        _show_runs(path, json)
        return
    heads, foreign = _heads(path)
    found = [_described(read_log(head.path, tolerant=True)) for head in heads]
    for said in foreign:
        remarks().print(said)
    lossy = sum(bool(log["problems"]) for log in found)
    state = f"{lossy} of them not complete" if lossy else "nothing lost"
    total = [f"{len(found)} logs, {state}."] if len(found) > 1 else []
    shown = (one for log in found for one in _info_of(log))
    present(json, {"logs": found}, *total, *shown)


@log_app.command()
def check(path: LogOrFolder, json: JsonFlag = False) -> int:
    """Count samples expected and received, list every gap, and sum up in a line.

    A campaign is complete when every run of its protocol is. Earlier attempts of a run that was
    recorded again, and logs that were repaired, are listed and not counted. Exit code 0 if
    complete, 1 if samples or runs are missing, 5 if a file is damaged.
    """
    from rig.log.attempts import standing
    from rig.log.check import Verdict, check_log
    from rig.log.streams import SAMPLE
    from rig.recording.campaign import MANIFEST, read_manifest

    heads, foreign = _heads(path)
    logs = [log.path for log in standing(heads)]
    superseded = [log.path for log in heads if log.path not in logs]
    reports = [check_log(item) for item in logs]
    missing = []
    if (path / MANIFEST).is_file():
        there = {report.run for report in reports}
        plans = read_manifest(path)[0].any_plans()
        missing = [plan.name for plan in plans if plan.name not in there]
    codes = [ExitCode.OK, *(report.verdict.exit_code for report in reports)]
    codes += [ExitCode.FAILED] if missing else []
    codes += [ExitCode.DATA] if foreign else []
    code = max(codes)
    said = [line for report in reports for line in _report_lines(report)]
    said += [f"no log      {words}" for words in foreign]
    said += [f"superseded  {item}: not counted" for item in superseded]
    said += [f"missing     {name}. Record it: rig record --resume {path}" for name in missing]
    whole = sum(report.verdict is Verdict.COMPLETE for report in reports)
    topics: list[TopicReport] = []
    for report in reports:  # of the stream of samples, whose counts are not other samples
        topics += [t for t in report.topics if t.topic == SAMPLE] or report.topics
    received, expected = sum(t.received for t in topics), sum(t.expected for t in topics)
    runs = f"{whole} of {len(reports) + len(missing)} runs complete"
    line = f"{runs}, {received} of {expected} samples"
    if superseded:
        line += f"; {counted(len(superseded), 'superseded log')} not counted"
    said.append(f"{line}.")
    found = {"logs": reports, "superseded": superseded, "missing_runs": missing}
    present(json, {**found, "no_logs": foreign, "exit_code": int(code)}, *said)
    return int(code)


def _heads(path: Path) -> "tuple[list[LogFile], list[str]]":
    """Return the heads of the logs at a path, and the files of a folder that are no logs."""
    from rig.log.check import logs_in
    from rig.log.reader import read_head
    from rig.log.scan import NotALogError

    heads, foreign = [], []
    logs = logs_in(path)
    if not logs:
        raise UsageError(f"There is no log in {path}.", fix="Name a file or another folder.")
    for item in logs:
        try:
            heads.append(read_head(item))
        except NotALogError as error:
            if item == path:
                raise
            foreign.append(error.what)
    return heads, foreign


@log_app.command()
def repair(
    path: OneLog,
    out: Annotated[
        Path | None, Option(help="File to write; NAME.repaired.mcap by default.")
    ] = None,
    json: JsonFlag = False,
) -> int:
    """Write the readable part of a damaged log to a new file; the original is not changed.

    Exit code 5 where no sample is readable: the new file has what is known of the run alone.
    """
    from rig.log.repair import repair_log

    report = repair_log(path, out)
    present(json, report, *_repair_lines(report))
    is_empty = report.repaired is not None and not any(report.recovered.values())
    return ExitCode.DATA if is_empty else ExitCode.OK


log_app.command()(export)


def _described(log: "LogFile") -> dict[str, Any]:
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


def _info_of(log: dict[str, Any]) -> Iterator[str]:
    run, end = log["run"], log["end"]
    yield f"{log['path']}: {'; '.join(log['problems']) or 'complete, nothing lost'}"
    yield f"  {log['bytes'] / 1e6:.2f} MB, written by {log['written_by']}"
    if run is not None:
        yield f"  run {run.name} of {run.rig or 'an unnamed rig'}: {listed(run.conditions) or '-'}"
        started = utc_of(run.started_at_ns) or "at an unknown time"
        yield f"  started {started}; notes: {run.notes or '-'}"
        excluded = log["excluded"]
        yield f"  excluded: {excluded}" if excluded else "  counts as evidence"
    state = "not closed" if end is None else "clean" if end.clean else f"not clean: {end.reason}"
    yield f"  end {state}{'; the file is damaged' if log['damaged'] else ''}"
    for topic in log["topics"]:
        rate = f", {topic['rate_hz']:.2f} Hz" if topic["rate_hz"] else ""
        length = f"{topic['messages']} messages in {topic['duration_s']:.3f} s{rate}"
        yield f"  {topic['topic']}: {length}: {', '.join(topic['fields'])}"
    for mark in log["marks"]:
        yield f"  mark at {mark.time_s:.3f} s: {mark.text}"
    for name, size in log["attachments"].items():
        yield f"  attached {name}, {size} bytes"


def _is_of_another_format(path: Path) -> bool:
    """Whether an importer other than that of the project's logs recognises a path."""
    from rig.importers.registry import importers

    known = importers()
    return (
        path.exists()
        and not known.pop("log").recognises(path)
        and any(one.recognises(path) for one in known.values())
    )


def _show_runs(path: Path, json: bool) -> None:
    from rig.importers.registry import open_campaign

    campaign = open_campaign(path)
    say_left_out(path, campaign)
    runs: list[dict[str, Any]] = []
    channels: dict[str, None] = {}
    for recording in campaign:
        channels |= dict.fromkeys(recording.columns)
        runs.append(
            {
                "name": recording.name,
                "samples": len(recording),
                "duration_s": float(recording.time_s[-1] - recording.time_s[0]),
                "rate_hz": recording.sample_rate_hz,
                "conditions": dict(recording.conditions),
                "instrument": recording.instrument,
                "flagged": int((recording.flags != 0).sum()),
                "excluded": recording.excluded,
                "notes": recording.notes,
            }
        )
    said = [f"{counted(len(runs), 'run')}. Channels: {', '.join(channels)}."]
    width = max((len(run["name"]) for run in runs), default=0)
    for run in runs:
        flagged = f"; flagged samples: {run['flagged']}" if run["flagged"] else ""
        excluded = f"; does not count: {run['excluded']}" if run["excluded"] else ""
        said.append(
            f"{run['name']:{width}}  {run['duration_s']:.3f} s, {run['rate_hz']:.4g} Hz"
            f"  {listed(run['conditions'])}{flagged}{excluded}"
        )
    present(json, {"runs": runs, "channels": list(channels)}, *said)


def _report_lines(report: "LogReport") -> Iterator[str]:
    yield f"{report.verdict.value:10}  {report.path}"
    for topic in report.topics:
        yield f"  {topic.topic}: {topic.received} of {topic.expected} samples"
        for gap in topic.gaps:
            lost = counted(gap.samples, "sample")
            at = f"{gap.first_sequence}"
            if gap.samples > 1:
                at += f" to {gap.last_sequence}"
            yield f"    gap at {gap.start_s:.4f} s, {gap.length_s * 1e3:.1f} ms: {lost}, {at}"
    for problem in report.problems:
        yield f"  {problem}"
    for damage in report.damage:
        yield f"    byte {damage.offset}, {damage.length} bytes: {damage.what}"


def _repair_lines(report: "RepairReport") -> Iterator[str]:
    from rig.log.streams import SAMPLE

    if report.repaired is None:
        yield f"{report.original} is not damaged; nothing was written."
        return
    if any(report.recovered.values()):
        yield f"wrote {report.repaired}, and read it back equal"
    else:
        yield (
            f"No sample of {report.original} is readable. {report.repaired} has what is known of"
            " the run, and no sample. Record the run again."
        )
    for topic, count in report.recovered.items():
        what = "samples" if topic == SAMPLE else "messages"  # of the same samples
        unproven = report.salvaged.get(topic, 0)
        note = f", {unproven} of them from the torn end, without a checksum" if unproven else ""
        lost = report.lost.get(topic, 0)
        yield f"  {topic}: {count} {what} recovered{note}; {lost} known lost"
    yield f"{report.original} is unchanged."
