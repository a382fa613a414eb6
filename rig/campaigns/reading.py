"""What the index keeps of a log, read from the log's records without its samples."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rig.campaigns.index import CALIBRATION, IndexedRun
from rig.log.attempts import is_unfinished, run_name, standing
from rig.log.reader import LogFile, read_head
from rig.log.scan import NotALogError
from rig.log.streams import SAMPLE
from rig.output.provenance import utc_of


def runs_in(paths: Sequence[Path]) -> list[IndexedRun]:
    """Return the runs of a folder's logs; of several attempts at a run the one that counts."""
    heads, runs = [], []
    for path in paths:
        try:
            heads.append(read_head(path))
        except NotALogError as error:
            why, name = str(error), path.name
            runs.append(IndexedRun(name, path.stem, "", "", "", "", {}, "", why, 0, 0, None, why))
    return [*runs, *map(_indexed, standing(heads))]


def _indexed(log: LogFile) -> IndexedRun:
    run, end = log.run, log.end
    conditions = dict(run.conditions) if run else {}
    samples = log.indexed.get(SAMPLE, 0)
    expected = end.expected_samples.get(SAMPLE, 0) if end else 0
    identity = asdict(run.instrument) if run else {}
    instrument = " ".join(str(value) for value in identity.values() if value is not None)
    return IndexedRun(
        file=log.path.name,
        name=run_name(log),
        rig=run.rig if run else "",
        instrument=instrument,
        date=utc_of(run.started_at_ns) if run else "",
        protocol=_protocol(log),
        conditions=conditions,
        notes=run.notes if run else "",
        state=_state(log),
        samples=samples,
        lost=max(expected - samples, 0),
        duration_s=run.duration_s if run else None,
        excluded=(run.excluded if run else None) or (end.excluded if end else None) or "",
    )


def _protocol(log: LogFile) -> str:
    """Return the protocol of a run, or the calibration whose raw log it is."""
    if log.run is None:
        return ""
    if kind := log.run.details.get("calibration"):
        return f"{CALIBRATION} {kind}"
    return str(log.run.conditions.get("protocol", ""))


def _state(log: LogFile) -> str:
    if is_unfinished(log):
        return "not closed"
    if log.damage:
        return "damaged"
    if log.end and not log.end.clean:
        return f"aborted: {log.end.reason}" if log.end.reason else "aborted"
    return "complete"
