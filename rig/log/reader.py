"""Reading a log: its messages as arrays, and what was known about the run."""

import mmap
import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Channel
from numpy.typing import NDArray

from estimation.recording import Mark, Stretch
from rig.errors import DataError, UsageError
from rig.log.chunks import read_chunks
from rig.log.container import LIBRARY, Attached
from rig.log.run import KINDS, RunEnd, RunInfo, from_metadata
from rig.log.scan import Damage, NotALogError, Skeleton, scan
from rig.log.schema import CHECKSUM_KEY, LayoutError, Stream


class DamagedLogError(DataError):
    """The log is damaged; the readable part can be recovered."""


@dataclass(frozen=True, eq=False)
class Topic:
    """The messages of one stream.

    Attributes:
        stream: Their layout.
        records: Message records of the stream's `record_dtype`, shape (n,), in file order.
    """

    stream: Stream
    records: NDArray[np.void]

    @property
    def rows(self) -> NDArray[np.void]:
        """Their fields, structured array of the stream's dtype, shape (n,)."""
        rows: NDArray[np.void] = self.records["payload"].view(self.stream.dtype)
        return rows

    @property
    def log_time_ns(self) -> NDArray[np.uint64]:
        """When each was taken, ns, shape (n,)."""
        times: NDArray[np.uint64] = self.records["log_time"]
        return times

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
        library: Program that wrote it.
        run: Metadata of the start, or None when that record is missing.
        end: Metadata of the end, or None when the log was not closed.
        topics: Topic name to messages; streams without messages are there too.
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

    def attached(self, name: str) -> bytes | None:
        """Return the content of the file of a name that the log carries; None without it."""
        return next((item.data for item in self.attachments if item.name == name), None)


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
    streams, unread = _streams(skeleton)
    known = {stream.topic for stream in streams.values()}
    missing = set(topics or ()) - known
    if missing and not skeleton.damage:
        raise UsageError(
            f"{path} has no topic {', '.join(sorted(missing))}.",
            f"It has: {', '.join(sorted(known)) or 'none'}.",
        )
    wanted = {n for n, stream in streams.items() if topics is None or stream.topic in topics}
    found = read_chunks(buffer, skeleton.chunks, streams, wanted)
    records, damage = _records(skeleton)
    log = LogFile(
        path=path,
        library=skeleton.library,
        run=(records[RunInfo] or [None])[-1],
        end=(records[RunEnd] or [None])[-1],
        marks=tuple(records[Mark]),
        stretches=tuple(records[Stretch]),
        topics={
            streams[n].topic: Topic(streams[n], found.data[n].view(streams[n].record_dtype))
            for n in sorted(wanted)
        },
        attachments=tuple(
            Attached(item.name, item.media_type, item.data) for item in skeleton.attachments
        ),
        metadata=tuple(item for item in skeleton.metadata if item[0] not in KINDS),
        unread=unread,
        damage=(*skeleton.damage, *found.damage, *damage),
        unchecked_chunks=sum(chunk.crc == 0 for chunk in skeleton.chunks),
        salvaged={streams[number].topic: count for number, count in found.salvaged.items()},
        indexed={
            stream.topic: sum(chunk.indexed.get(number, 0) for chunk in skeleton.chunks)
            for number, stream in streams.items()
        },
    )
    if log.damage and not tolerant:
        raise damaged(log)
    return log


def read_head(path: Path) -> LogFile:
    """Read what is known about a log without its samples.

    Raises:
        NotALogError: The file is not MCAP.
    """
    return read_log(path, topics=(), tolerant=True, checksums=False)


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


def _streams(skeleton: Skeleton) -> tuple[dict[int, Stream], tuple[str, ...]]:
    """Return the stream of each channel of fixed size by number, and the topics of the others."""
    streams: dict[int, Stream] = {}
    unread = []
    for number, channels in skeleton.channels.items():
        stream = _stream(skeleton, channels)
        if stream is None or stream.topic in {known.topic for known in streams.values()}:
            unread.append(channels[0].topic)
        else:
            streams[number] = stream
    return streams, tuple(unread)


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


def _records(skeleton: Skeleton) -> tuple[dict[type, list[Any]], list[Damage]]:
    """Return the metadata records of our own kinds by kind, and those that cannot be read."""
    records: dict[type, list[Any]] = {kind: [] for kind in KINDS.values()}
    damage = []
    for name, data in skeleton.metadata:
        if name in KINDS:
            try:
                records[KINDS[name]].append(from_metadata(name, data))
            except DataError as error:
                damage.append(Damage(0, 0, error.what))
    return records, damage
