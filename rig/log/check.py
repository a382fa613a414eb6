"""Is a log whole: samples expected and received, every gap, every damaged place.

What was expected is known three ways: from the sequence numbers, from the plan, and from what the
recorder had counted when it closed the log. The largest of them counts.
"""

from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.errors import ExitCode
from rig.log.container import LIBRARY, MAGIC
from rig.log.messages import not_finite
from rig.log.order import by_number
from rig.log.reader import LogFile, Topic, read_log
from rig.log.scan import Damage
from rig.log.writer import PART_SUFFIX
from rig.output.table import counted

PLAN_TOLERANCE = 1e-3
"""Relative shortfall against the plan that two clocks explain."""


class Verdict(Enum):
    """Result of a check."""

    COMPLETE = "complete"
    INCOMPLETE = "incomplete"  # what is there is sound, but samples are missing or out of order
    DAMAGED = "damaged"  # the file itself is torn or altered

    @property
    def exit_code(self) -> ExitCode:
        """Exit code of a check that ends so."""
        codes = {Verdict.COMPLETE: ExitCode.OK, Verdict.INCOMPLETE: ExitCode.FAILED}
        return codes.get(self, ExitCode.DATA)


@dataclass(frozen=True, slots=True)
class Gap:
    """Samples that are missing between two that are there."""

    first_sequence: int
    last_sequence: int
    samples: int
    start_s: float  # time of the last sample before the gap, s, in the stream's own time
    length_s: float  # time from that sample to the first one after the gap, s


@dataclass(frozen=True)
class TopicReport:
    """Result of a check of one stream."""

    topic: str
    received: int  # samples in the file
    expected: int  # samples that should be there: the largest of the three below and of `received`
    # from the first sequence number to the last; None without them
    expected_by_sequence: int | None
    expected_by_plan: int | None  # from the planned duration and rate; None without a plan
    # what the recorder had counted at the end; None if not recorded
    expected_by_recorder: int | None
    gaps: tuple[Gap, ...]
    repeats: int  # samples whose sequence number does not come after the one before
    time_steps_back: int  # samples whose time does not come after the one before
    not_finite: int  # samples with a measurement that is not finite, all of them
    not_finite_unflagged: int  # those of them that no flag explains
    salvaged: int  # samples from the torn end of the file, which no checksum vouches for

    @property
    def sound(self) -> bool:
        """Whether nothing is missing, repeated, out of order or unexplained."""
        wrong = (self.gaps, self.repeats, self.time_steps_back, self.not_finite_unflagged)
        planned = (self.expected_by_plan or 0) * (1 - PLAN_TOLERANCE) - 1
        recorded = self.expected_by_recorder or 0
        return not any(wrong) and self.received >= max(planned, recorded)


@dataclass(frozen=True)
class LogReport:
    """Result of a check."""

    path: Path
    run: str | None  # name of the run; None when that is lost
    verdict: Verdict
    closed: bool  # whether the recorder closed the log
    problems: tuple[str, ...]  # faults in words; empty when the log is complete
    topics: tuple[TopicReport, ...]
    damage: tuple[Damage, ...]
    unchecked_chunks: int  # chunks that carry no checksum


def check_log(path: Path) -> LogReport:
    """Check a log.

    Raises:
        NotALogError: The file is not MCAP.
        UsageError: The file is not there.
    """
    return report_on(read_log(path, tolerant=True))


def logs_in(path: Path) -> list[Path]:
    """Return the logs at a path: the file itself, or all logs of a folder, unfinished ones too."""
    if not path.is_dir():
        return [path]
    found = [*path.glob("*.mcap"), *path.glob(f"*.mcap{PART_SUFFIX}")]
    return sorted(found, key=lambda log: by_number(log.name))


def looks_like_log(path: Path) -> bool:
    """Whether a file is a log, by its name and first bytes."""
    if not path.name.endswith((".mcap", f".mcap{PART_SUFFIX}")) or not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def report_on(log: LogFile) -> LogReport:
    """Judge a log that was read tolerantly."""
    topics = tuple(_topic_report(log, name, topic) for name, topic in log.topics.items())
    incomplete = [problem for topic in topics for problem in _shortfalls(topic)]
    damage = [item.what for item in log.damage]
    if written_by_rig(log):
        damage += [f"the definition of {name} is damaged" for name in log.unread]
        if log.run is None:
            damage.append("what was known about the run is lost")
        if log.end is None:
            damage.append("the recorder did not close the log")
    if log.end is not None and not log.end.clean:
        incomplete.append(f"the run did not end as planned: {log.end.reason or 'no reason given'}")
    sound = Verdict.INCOMPLETE if incomplete else Verdict.COMPLETE
    return LogReport(
        path=log.path,
        run=log.run.name if log.run else None,
        verdict=Verdict.DAMAGED if damage else sound,
        closed=log.end is not None,
        problems=(*damage, *incomplete),
        topics=topics,
        damage=log.damage,
        unchecked_chunks=log.unchecked_chunks,
    )


def written_by_rig(log: LogFile) -> bool:
    """Whether a log states that rig wrote it, and so must have all that rig writes."""
    return log.library.startswith(f"{LIBRARY} ")


def _topic_report(log: LogFile, name: str, topic: Topic) -> TopicReport:
    time_s = stream_time_s(topic)
    by_sequence: int | None = None
    gaps: tuple[Gap, ...] = ()
    repeats = 0
    if "sequence" in topic.columns:
        by_sequence, gaps, repeats = _sequence_findings(topic.rows["sequence"], time_s)
    by_plan = None
    if log.run and log.run.duration_s is not None and topic.stream.rate_hz is not None:
        by_plan = round(log.run.duration_s * topic.stream.rate_hz)
    by_recorder = log.end.expected_samples.get(name) if log.end else None
    bad = not_finite(topic.stream, topic.rows)
    flagged = topic.rows["flags"] != 0 if "flags" in topic.columns else np.zeros(len(topic), bool)
    backwards = np.diff(time_s) <= 0 if "time_s" in topic.columns else np.diff(time_s) < 0
    return TopicReport(
        topic=name,
        received=len(topic),
        expected=max(len(topic), by_sequence or 0, by_plan or 0, by_recorder or 0),
        expected_by_sequence=by_sequence,
        expected_by_plan=by_plan,
        expected_by_recorder=by_recorder,
        gaps=gaps,
        repeats=repeats,
        time_steps_back=int(backwards.sum()),
        not_finite=int(bad.sum()),
        not_finite_unflagged=int((bad & ~flagged).sum()),
        salvaged=log.salvaged.get(name, 0),
    )


def stream_time_s(topic: Topic) -> NDArray[np.float64]:
    """Return a stream's own time, s, shape (n,): its field `time_s`, or else its log times."""
    if "time_s" in topic.columns:
        time_s: NDArray[np.float64] = topic.rows["time_s"]
        return time_s
    if not len(topic):
        return np.empty(0)
    elapsed_ns: NDArray[np.uint64] = topic.log_time_ns - topic.log_time_ns.min()
    return elapsed_ns.astype(np.float64) * 1e-9


def _sequence_findings(
    sequence: NDArray[np.uint32], time_s: NDArray[np.float64]
) -> tuple[int, tuple[Gap, ...], int]:
    """Return the samples expected, the gaps, and how many samples repeat or run back."""
    if not sequence.size:
        return 0, (), 0
    # differences of the 32-bit counter, so that its wrap is a step of one like any other
    bits = sequence.dtype.itemsize * 8
    step = np.diff(sequence).astype(np.int64) % (1 << bits)
    forward = (step > 0) & (step < 1 << (bits - 1))
    gaps = tuple(
        Gap(
            first_sequence=(int(sequence[k]) + 1) % (1 << bits),
            last_sequence=(int(sequence[k + 1]) - 1) % (1 << bits),
            samples=int(step[k]) - 1,
            start_s=float(time_s[k]),
            length_s=float(time_s[k + 1] - time_s[k]),
        )
        for k in np.flatnonzero(forward & (step > 1))
    )
    expected = int(sequence.size) + sum(gap.samples for gap in gaps)
    return expected, gaps, int((~forward).sum())


def _shortfalls(topic: TopicReport) -> list[str]:
    """Say in words what one stream lacks."""
    name = topic.topic
    found = []
    if topic.gaps:
        lost = sum(gap.samples for gap in topic.gaps)
        missing = f"{counted(lost, 'sample')} {'is' if lost == 1 else 'are'} missing"
        found.append(f"{name}: {missing} in {counted(len(topic.gaps), 'gap')}")
    if topic.repeats:
        found.append(f"{name}: {topic.repeats} samples repeat or run back in sequence")
    if topic.time_steps_back:
        found.append(f"{name}: time does not increase at {topic.time_steps_back} samples")
    if topic.not_finite_unflagged:
        found.append(f"{name}: {topic.not_finite_unflagged} samples are not finite and not flagged")
    if not found and not topic.sound:
        found.append(f"{name}: {topic.received} of {topic.expected} expected samples are there")
    return found
