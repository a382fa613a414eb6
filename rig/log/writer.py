"""Writing a log so that a killed recorder loses at most a quarter of a second.

While it is recorded a log is called `NAME.mcap.part`; a clean close renames it to `NAME.mcap`. So a
file called `.mcap` is always whole, and the `.part` file of a killed recorder can be examined by
`rig log check` and recovered by `rig log repair`.

What was written is held in memory until it has waited `FLUSH_AFTER_S` or spans that much data time,
then it goes to the operating system as one chunk for each stream. What the operating system has,
`kill -9` cannot take away; only a power cut can.

A thread of the writer's own changes the file. Python raises KeyboardInterrupt in the main thread
alone, whichever thread the signal reaches, so no interrupt comes between bytes in the file and
their checksum, and none loses a block that is being written.
"""

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock
from typing import ParamSpec, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.files import sync_folder
from estimation.recording import Mark, Stretch
from rig import __version__
from rig.errors import RigError, UsageError
from rig.log.container import LIBRARY, Attached, Container
from rig.log.messages import Rows, message_records, packed_rows
from rig.log.run import RunEnd, RunInfo, to_metadata
from rig.log.schema import Stream

PART_SUFFIX = ".part"

MAX_LOSS_S = 0.25
"""The most data, s, that a killed recorder loses, if it calls `write` or `poll` every 50 ms."""

FLUSH_AFTER_S = 0.2
"""Age and data time at which a block is flushed: `MAX_LOSS_S` less the 50 ms between two calls."""

CHUNK_BYTES = 1 << 20
"""The most a chunk holds, unpacked; a recording written in one go is cut into such chunks."""

P = ParamSpec("P")
T = TypeVar("T")


class LogExistsError(UsageError):
    """A log of that name is there already, and logs are never overwritten."""


class LogWriteError(RigError):
    """The operating system did not take the data, for example because the disk is full."""


class LogWriter:
    """Writes one run.

    Use it as a context manager. Leaving the block closes the log as clean; leaving it by an
    exception closes it too, with the exception as the reason why the run is not clean. `close` and
    `discard` do it by hand. Each call raises LogWriteError where the operating system refuses the
    data.

    The metadata of the run and the files to carry are written immediately; the clock is monotonic,
    s.

    Raises:
        LogExistsError: There is a log or a part of one at the path.
        UsageError: The path does not end in `.mcap`, or two streams share a topic.
        DataError: The run's metadata cannot be written.
    """

    def __init__(
        self,
        path: Path,
        run: RunInfo,
        streams: Sequence[Stream],
        *,
        attachments: Sequence[Attached] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if path.suffix != ".mcap":
            raise UsageError(f"A log is named NAME.mcap, not {path.name}.")
        self.path = path
        self.part = path.with_name(path.name + PART_SUFFIX)
        for taken in (path, self.part):
            if taken.exists():
                raise LogExistsError(
                    f"There is a log at {taken} already.",
                    "Logs are never overwritten.",
                    "Choose another name, or move that file away.",
                )
        self._streams = {stream.topic: stream for stream in streams}
        if len(self._streams) < len(streams):
            raise UsageError("Two streams of the log share a topic.")
        self.received = dict.fromkeys(self._streams, 0)
        """Topic to the number of messages written so far."""
        run_metadata = to_metadata(run)
        self._clock = clock
        self._pending: dict[str, list[NDArray[np.void]]] = {}
        self._pending_lock = Lock()
        self._waiting_since_s = 0.0
        self._closed = False
        self._thread = ThreadPoolExecutor(1, "log")
        try:
            self._file = self.part.open("xb")
        except OSError as error:
            raise LogWriteError(f"The log {self.part} cannot be made.", str(error)) from None
        try:
            self._in_turn(self._begin, streams, run_metadata, attachments, run.started_at_ns or 0)
        except BaseException:  # an interruption too: the file holds nothing that was recorded
            self.discard()
            raise

    def _begin(
        self,
        streams: Sequence[Stream],
        run_metadata: tuple[str, Mapping[str, str]],
        attachments: Sequence[Attached],
        started_at_ns: int,
    ) -> None:
        with self._giving_to_system():
            self._container = Container(self._file, f"{LIBRARY} {__version__}")
            self._container.add_metadata(*run_metadata)
            self._channels = {s.topic: self._container.add_stream(s) for s in streams}
            for attached in attachments:
                self._container.add_attachment(attached, started_at_ns)
            self._file.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: object, _: object) -> None:
        reason = "" if kind is None else f"{kind.__name__}: {error}".strip(": ")
        self.close(RunEnd(clean=kind is None, reason=reason))

    def write(self, topic: str, rows: Rows, log_time_ns: ArrayLike) -> None:
        """Take a block of messages; it is in the operating system within `MAX_LOSS_S`.

        The rows are a structured array of shape (n,) or one array for each field. A message with a
        value that is not finite must have the reason in its field `flags`. The log times are ns
        since the Unix epoch, shape (n,).

        Raises:
            UnflaggedSampleError: A value is not finite and the message's flags are 0.
            DataError: Fields are missing, unknown, of different lengths or out of range.
            UsageError: The log has no such topic.
        """
        if topic not in self._streams:
            raise UsageError(
                f"The log has no stream {topic!r}.", f"It has: {', '.join(self._streams)}."
            )
        stream = self._streams[topic]
        payload = packed_rows(stream, rows)
        if not payload.size:
            return
        messages = message_records(
            stream, payload, log_time_ns, self._channels[topic], self.received[topic]
        )
        self.received[topic] += payload.size
        with self._pending_lock:
            if not self._pending:
                self._waiting_since_s = self._clock()
            self._pending.setdefault(topic, []).append(messages)
        if self._spans_ns() >= FLUSH_AFTER_S * 1e9:
            self.flush()
        self.poll()

    def poll(self) -> bool:
        """Flush if the oldest message has waited long enough; return whether it did.

        A recorder's loop calls this at least every 50 ms, also while no samples arrive.
        """
        if not self._pending or self._clock() - self._waiting_since_s < FLUSH_AFTER_S:
            return False
        self.flush()
        return True

    def flush(self) -> None:
        """Hand everything written so far to the operating system."""
        self._in_turn(self._flush)

    def _flush(self) -> None:
        with self._pending_lock:
            pending, self._pending = self._pending, {}
        with self._giving_to_system():
            for topic, blocks in pending.items():
                messages = np.concatenate(blocks)
                step = max(1, CHUNK_BYTES // messages.dtype.itemsize)
                for start in range(0, messages.size, step):
                    part = messages[start : start + step]
                    self._container.add_chunk(self._channels[topic], part)
            self._file.flush()

    def add(self, *records: Mark | Stretch) -> None:
        """Write operator's marks and flagged stretches at once."""
        for record in records:
            self.add_metadata(*to_metadata(record))

    def add_metadata(self, name: str, data: Mapping[str, str]) -> None:
        """Write a metadata record of any name at once."""
        self._in_turn(self._add_metadata, name, data)

    def _add_metadata(self, name: str, data: Mapping[str, str]) -> None:
        with self._giving_to_system():
            self._container.add_metadata(name, data)
            self._file.flush()

    def close(self, end: RunEnd | None = None) -> Path:
        """Write what is known at the end, a clean one when None, and give the file its name.

        A log that is closed, or could not be written, stays as it is.

        Raises:
            LogWriteError: The operating system refused the data; what it took is in the `.part`.
        """
        end_metadata = to_metadata(end or RunEnd())
        if not self._closed:
            self._in_turn(self._close, *end_metadata)
        self._thread.shutdown()
        return self.path

    def _close(self, name: str, data: Mapping[str, str]) -> None:
        if self._closed:
            return
        self._flush()
        with self._giving_to_system():
            self._container.add_metadata(name, data)
            self._container.finish()
            self._file.flush()
            os.fsync(self._file.fileno())
            self._abandon()
            self.part.rename(self.path)
            sync_folder(self.path.parent)

    def discard(self) -> None:
        """Close and delete what was written: for a log that is a copy of something else."""
        if not self._closed:
            self._in_turn(self._abandon)
        self._thread.shutdown()
        self.part.unlink(missing_ok=True)

    def _abandon(self) -> None:
        """Close the file as it stands."""
        self._closed = True
        with suppress(OSError):  # the first error is more useful than that of flushing
            self._file.close()

    def _in_turn(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Do something in the thread that changes the file, after what was begun before."""
        try:
            return self._thread.submit(work, *args, **kwargs).result()
        except LogWriteError:
            self._thread.shutdown()
            raise

    @contextmanager
    def _giving_to_system(self) -> Iterator[None]:
        """Convert an error of the operating system to ours; the file is not changed."""
        try:
            yield
        except OSError as error:
            self._abandon()
            raise LogWriteError(
                f"{self.part} could not be written: {error.strerror or error}.",
                "What the system took before that is in the file.",
                f"Make room, then run `rig log repair {self.part}`.",
            ) from None

    def _spans_ns(self) -> int:
        """Data time, ns, from the first message that waits to the last."""
        blocks = [block for blocks in self._pending.values() for block in blocks]
        first = min(int(block["log_time"][0]) for block in blocks)
        return max(int(block["log_time"][-1]) for block in blocks) - first
