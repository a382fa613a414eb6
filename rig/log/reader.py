"""Reading a log: its messages as arrays, and what was known about the run."""

import mmap
import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from mcap.records import Channel
from numpy.typing import NDArray

from estimation.recording import Mark, Stretch
from rig.errors import DataError, UsageError
from rig.log.chunks import Layout, read_chunks
from rig.log.container import LIBRARY, Attached
from rig.log.run import (
    END_RECORD,
    MARK_RECORD,
    RUN_RECORD,
    STRETCH_RECORD,
    RunEnd,
    RunInfo,
    from_metadata,
)
from rig.log.scan import Damage, NotALogError, Skeleton, scan
from rig.log.schema import CHECKSUM_KEY, LayoutError, Stream


class DamagedLogError(DataError):
    """The log is damaged; the readable part can be recovered."""


@dataclass(frozen=True, eq=False)
class Topic:
    """The messages of one stream.

    Attributes:
        stream: Their layout.
        rows: Their fields, structured array of the stream's dtype, shape (n,), in file order.
        log_time_ns: When each was taken, ns, uint64, shape (n,).
    """

    stream: Stream
    rows: NDArray[np.void]
    log_time_ns: NDArray[np.uint64]

    def __len__(self) -> int:
        return int(self.rows.size)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the fields, in order."""
        return tuple(field.name for field in self.stream.fields)


@dataclass(frozen=True, eq=False)
class LogFile:
    """A log that was read.

    Attributes:
        path: File it was read from.
        library: Program that wrote it.
        run: Metadata of the start, or None when that record is missing.
        end: Metadata of the end, or None when the log was not closed.
        marks: Operator's marks.
        stretches: Flagged stretches.
        topics: Topic name to messages; streams without messages are there too.
        attachments: Files carried in the log.
        metadata: Metadata records of other names.
        unread: Topics whose messages are not of fixed size, and were not read.
        damage: Damaged parts; empty unless the log was read tolerantly.
        unchecked_chunks: Chunks that carry no checksum.
        salvaged: Topic to the number of messages from the torn end of the file, which no checksum
            vouches for.
        indexed: Topic to the number of messages that the file's index states, of all topics.
    """

    path: Path
    library: str
    run: RunInfo | None
    end: RunEnd | None
    marks: tuple[Mark, ...]
    stretches: tuple[Stretch, ...]
    topics: Mapping[str, Topic]
    attachments: tuple[Attached, ...]
    metadata: tuple[tuple[str, Mapping[str, str]], ...]
    unread: tuple[str, ...] = ()
    damage: tuple[Damage, ...] = ()
    unchecked_chunks: int = 0
    salvaged: Mapping[str, int] = field(default_factory=dict)
    indexed: Mapping[str, int] = field(default_factory=dict)


def read_log(
    path: Path,
    topics: Collection[str] | None = None,
    *,
    tolerant: bool = False,
    checksums: bool = True,
) -> LogFile:
    """Read a log.

    Args:
        path: A `.mcap` file, or the `.mcap.part` of a recorder that was killed.
        topics: Topics to read; all when None, none when empty. Chunks of other topics are not
            unpacked.
        tolerant: Read what is readable and list the damage, instead of raising.
        checksums: Check the file's overall checksum as well as each chunk's. That reads the whole
            file; omit it to read metadata only.

    Raises:
        DamagedLogError: The log is damaged, and `tolerant` is False.
        NotALogError: The file is not MCAP.
        UsageError: The file is not there, or has no such topic.
    """
    buffer = _map(path)
    skeleton = scan(buffer, path, checksums=checksums)
    layouts, unread = _layouts(skeleton)
    known = {layout.topic for layout in layouts.values()}
    missing = set(topics or ()) - known
    if missing and not skeleton.damage:
        raise UsageError(
            f"{path} has no topic {', '.join(sorted(missing))}.",
            f"It has: {', '.join(sorted(known)) or 'none'}.",
        )
    wanted = {n for n, layout in layouts.items() if topics is None or layout.topic in topics}
    found = read_chunks(buffer, skeleton.chunks, layouts, wanted)
    log = LogFile(
        path=path,
        library=skeleton.library,
        run=None,
        end=None,
        marks=(),
        stretches=(),
        topics={
            layouts[n].topic: Topic(layouts[n].stream, found.rows[n], found.log_time_ns[n])
            for n in sorted(wanted)
        },
        attachments=tuple(
            Attached(item.name, item.media_type, item.data) for item in skeleton.attachments
        ),
        metadata=(),
        unread=unread,
        damage=(*skeleton.damage, *found.damage),
        unchecked_chunks=sum(chunk.crc == 0 for chunk in skeleton.chunks),
        salvaged={layouts[number].topic: count for number, count in found.salvaged.items()},
        indexed={
            layout.topic: sum(chunk.indexed.get(number, 0) for chunk in skeleton.chunks)
            for number, layout in layouts.items()
        },
    )
    log = _with_records(log, skeleton.metadata)
    if log.damage and not tolerant:
        raise damaged(log)
    return log


def damaged(log: LogFile) -> DamagedLogError:
    """Return the error that describes the damage of a log."""
    first = log.damage[0]
    more = f" and {len(log.damage) - 1} more" if len(log.damage) > 1 else ""
    return DamagedLogError(
        f"{log.path} is damaged: {first.what} (byte {first.offset}){more}.",
        "The recorder was killed, or the file was changed or cut after it was closed.",
        f"Run `rig log repair {log.path}` to save what is readable in a new file.",
    )


def _map(path: Path) -> memoryview:
    """Map a file into memory; pages are read when they are looked at."""
    try:
        with path.open("rb") as file:
            if os.fstat(file.fileno()).st_size == 0:
                raise NotALogError(
                    f"{path} is empty.",
                    fix="Omit it: delete it, or --skip-bad (fit, diagnose, view).",
                )
            return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
    except OSError as error:
        raise UsageError(
            f"{path} cannot be read: {error.strerror}.", fix="Check the path."
        ) from None


def _layouts(skeleton: Skeleton) -> tuple[dict[int, Layout], tuple[str, ...]]:
    """Return the layout of each channel of fixed size by number, and the topics of the others."""
    layouts: dict[int, Layout] = {}
    unread = []
    for number, channels in skeleton.channels.items():
        taken = {layout.topic for layout in layouts.values()}
        stream = _stream(skeleton, channels)
        if stream is None or stream.topic in taken:
            unread.append(channels[0].topic)
        else:
            layouts[number] = Layout(stream.topic, stream)
    return layouts, tuple(unread)


def _stream(skeleton: Skeleton, channels: list[Channel]) -> Stream | None:
    """Return the stream of a channel, from the first of its records that is sound."""
    for channel in channels:
        for schema in skeleton.schemas.get(channel.schema_id, []):
            if (schema.encoding, channel.message_encoding) != ("ros2msg", "cdr"):
                continue
            rate = channel.metadata.get("rate_hz")
            try:
                stream = Stream.from_definition(
                    channel.topic, schema.name, schema.data.decode(), float(rate) if rate else None
                )
            except (LayoutError, ValueError):
                continue
            stated = channel.metadata.get(CHECKSUM_KEY)
            ours = skeleton.library.startswith(f"{LIBRARY} ")
            if stated == stream.checksum or (stated is None and not ours):
                return stream
    return None


def _with_records(log: LogFile, metadata: list[tuple[str, dict[str, str]]]) -> LogFile:
    """Return the log with its metadata records understood."""
    run, end = log.run, log.end
    marks, stretches, others, damage = [], [], [], list(log.damage)
    for name, data in metadata:
        try:
            if name == RUN_RECORD:
                run = from_metadata(RunInfo, data)
            elif name == END_RECORD:
                end = from_metadata(RunEnd, data)
            elif name == MARK_RECORD:
                marks.append(from_metadata(Mark, data))
            elif name == STRETCH_RECORD:
                stretches.append(from_metadata(Stretch, data))
            else:
                others.append((name, data))
        except DataError as error:
            damage.append(Damage(0, 0, error.what))
    return replace(
        log,
        run=run,
        end=end,
        marks=tuple(marks),
        stretches=tuple(stretches),
        metadata=tuple(others),
        damage=tuple(damage),
    )
