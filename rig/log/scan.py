"""Walking the records of an MCAP file without unpacking its chunks, past any damage.

A record is taken only if its body is consumed exactly by its own inner lengths. Where that fails,
the walk looks for the next place where it succeeds, so one damaged length does not hide the rest.
"""

import io
import struct
import zlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import mcap.records as mcap
import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode

from rig.errors import DataError
from rig.log.container import MAGIC

T = TypeVar("T", mcap.Schema, mcap.Channel)

_HEAD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")
_INDEX = struct.Struct("<HI")
_WINDOW = 1 << 20  # Bytes that are searched at a time
# plain numbers: looking a member of an enumeration up is slow where it is done for every record
_CHUNK_OPCODE, _MESSAGE_INDEX_OPCODE, _CHUNK_INDEX_OPCODE = 0x06, 0x07, 0x08

_READERS: dict[Opcode, Any] = {
    Opcode.HEADER: mcap.Header,
    Opcode.FOOTER: mcap.Footer,
    Opcode.SCHEMA: mcap.Schema,
    Opcode.CHANNEL: mcap.Channel,
    Opcode.ATTACHMENT: mcap.Attachment,
    Opcode.ATTACHMENT_INDEX: mcap.AttachmentIndex,
    Opcode.STATISTICS: mcap.Statistics,
    Opcode.METADATA: mcap.Metadata,
    Opcode.METADATA_INDEX: mcap.MetadataIndex,
    Opcode.SUMMARY_OFFSET: mcap.SummaryOffset,
    Opcode.DATA_END: mcap.DataEnd,
}


class NotALogError(DataError):
    """The file is not an MCAP file at all."""


@dataclass(frozen=True, slots=True)
class Damage:
    """A damaged place of a file."""

    offset: int  # byte it starts at
    length: int  # bytes affected; 0 where something is missing
    what: str


@dataclass(slots=True)
class ChunkRef:
    """Where a chunk is and what it states about itself."""

    offset: int  # byte of the file its record starts at
    data: range  # range of its packed bytes in the file
    compression: str  # "zstd" or ""
    unpacked_bytes: int  # size once unpacked
    crc: int  # CRC-32 of the unpacked bytes; 0 for none
    torn: bool = False  # whether the file ends inside it
    # channel to the number of its messages, as the index records behind it state
    indexed: dict[int, int] = field(default_factory=dict)


@dataclass
class Skeleton:
    """Everything of a file but the messages in its chunks, in file order.

    Schemas and channels stand at the start and in the summary: where the two differ, both are kept.
    """

    library: str = ""
    schemas: dict[int, list[mcap.Schema]] = field(default_factory=dict)
    channels: dict[int, list[mcap.Channel]] = field(default_factory=dict)
    chunks: list[ChunkRef] = field(default_factory=list)
    metadata: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    attachments: list[mcap.Attachment] = field(default_factory=list)
    finished: bool = False
    damage: list[Damage] = field(default_factory=list)


def scan(buffer: memoryview, path: Path, *, checksums: bool = True) -> Skeleton:
    """Walk all records of a file, given as its bytes; the path is for the error.

    With `checksums` the CRC of the data section is checked, which reads the whole file.

    Raises:
        NotALogError: It contains no MCAP record.
    """
    skeleton = Skeleton()
    position, size = 8, len(buffer)
    if bytes(buffer[:8]) != MAGIC:
        skeleton.damage.append(Damage(0, min(8, size), "the file does not begin as MCAP"))
        position = 0
    while position < size and not skeleton.finished:
        parsed = _parse(buffer, position)
        if parsed is None:
            found = _next_record(buffer, position + 1)
            torn = None if found < size else _torn_chunk(buffer, position)
            if torn is not None:
                skeleton.chunks.append(torn)
                what = "the file ends inside a chunk"
            else:
                what = "unreadable record" if found < size else "unreadable end of the file"
            skeleton.damage.append(Damage(position, found - position, what))
            position = found
            continue
        record, stop = parsed
        if record is not None:
            _take(skeleton, record, position, buffer, checksums)
        position = stop
    if not (skeleton.library or skeleton.chunks or skeleton.channels):
        raise NotALogError(
            f"{path} is not an MCAP file.",
            "No record of that format was found in it.",
            "Restore a log, or omit it (fit, diagnose, view: --skip-bad). A table is read by"
            f" rig import {path} --machine FILE.",
        )
    _check_end(skeleton, buffer, position)
    return skeleton


def _parse(buffer: memoryview, start: int) -> tuple[Any, int] | None:
    """Return the record at a place and where the next begins; None without a whole one."""
    first = start + _HEAD.size
    if first > len(buffer):
        return None
    opcode, length = _HEAD.unpack_from(buffer, start)
    stop = first + length
    if stop > len(buffer):
        return None
    if opcode == _CHUNK_OPCODE:
        chunk = _parse_chunk(buffer, start)
        return (chunk, stop) if chunk is not None and chunk.data.stop == stop else None
    if opcode == _MESSAGE_INDEX_OPCODE:
        if length < 6:
            return None
        channel, size = _INDEX.unpack_from(buffer, first)
        whole = size == length - 6 and size % 16 == 0
        return ((channel, size // 16), stop) if whole else None
    if opcode == _CHUNK_INDEX_OPCODE:
        # the chunks were met already; the summary's checksum covers this
        return (None, stop) if length >= 64 else None
    if opcode not in _READERS:
        return None
    stream = ReadDataStream(_Body(buffer[first:stop]))
    try:
        record = _READERS[Opcode(opcode)].read(stream)
    except (struct.error, UnicodeDecodeError, EndOfFile, ValueError, OverflowError):
        return None
    return (record, stop) if stream.count == length else None


class _Body(io.BytesIO):
    """The bytes of a record; fewer than are asked for are never read."""

    def read(self, count: int | None = -1) -> bytes:
        data = super().read(count)
        if count is not None and len(data) < count:
            raise EndOfFile
        return data


def _parse_chunk(buffer: memoryview, start: int) -> ChunkRef | None:
    """Return the chunk a place states, whether or not the file holds all of it."""
    first = start + _HEAD.size
    try:
        _, _, unpacked, crc, name_length = _CHUNK.unpack_from(buffer, first)
        name_stop = first + _CHUNK.size + min(name_length, 4)
        name = bytes(buffer[first + _CHUNK.size : name_stop])
        (packed,) = struct.unpack_from("<Q", buffer, name_stop)
    except struct.error:
        return None
    if len(name) != name_length or name not in (b"", b"lz4", b"zstd"):
        return None
    data = range(name_stop + 8, name_stop + 8 + packed)
    return ChunkRef(start, data, name.decode(), unpacked, crc)


def _torn_chunk(buffer: memoryview, start: int) -> ChunkRef | None:
    """Return the chunk the file ends in, with the packed bytes that are there."""
    if buffer[start] != Opcode.CHUNK:
        return None
    chunk = _parse_chunk(buffer, start)
    if chunk is None or chunk.data.start >= len(buffer):
        return None
    data = range(chunk.data.start, min(chunk.data.stop, len(buffer)))
    return replace(chunk, data=data, torn=True)


def _next_record(buffer: memoryview, start: int) -> int:
    """Return the next place at or after start where a whole record begins, or the file's end."""
    array = np.frombuffer(buffer, np.uint8)
    for first in range(start, len(buffer), _WINDOW):
        part = array[first : first + _WINDOW + _HEAD.size]
        if part.size < _HEAD.size:
            break
        heads = np.lib.stride_tricks.sliding_window_view(part, _HEAD.size)
        # a record is shorter than 4 GiB: the upper half of its length is zero
        likely = (heads[:, 0] >= 1) & (heads[:, 0] <= 15) & ~heads[:, 5:].any(axis=1)
        for place in np.flatnonzero(likely):
            parsed = _parse(buffer, first + int(place))
            if parsed is not None and not _is_hollow(buffer, first + int(place)):
                return first + int(place)
    return len(buffer)


def _is_hollow(buffer: memoryview, start: int) -> bool:
    """Whether a record is so empty that zeros in other data could pass for it."""
    length = _HEAD.unpack_from(buffer, start)[1]
    return not any(buffer[start + _HEAD.size : start + _HEAD.size + min(length, 64)])


def _take(
    skeleton: Skeleton, record: Any, position: int, buffer: memoryview, checksums: bool
) -> None:
    """Add one record to the skeleton, checking the checksum it carries."""
    match record:
        case ChunkRef():
            skeleton.chunks.append(record)
        case (channel, messages) if skeleton.chunks:  # of a message index
            skeleton.chunks[-1].indexed[channel] = messages
        case mcap.Header():
            skeleton.library = record.library
        case mcap.Schema():
            _keep(skeleton, skeleton.schemas, record, position)
        case mcap.Channel():
            _keep(skeleton, skeleton.channels, record, position)
        case mcap.Metadata():
            skeleton.metadata.append((record.name, record.metadata))
        case mcap.Attachment():
            _take_attachment(skeleton, record, position, buffer)
        case mcap.DataEnd(data_section_crc=crc) if checksums and crc:
            if zlib.crc32(buffer[:position]) != crc:
                what = "the file's data section does not match its checksum"
                skeleton.damage.append(Damage(0, position, what))
        case mcap.Footer():
            skeleton.finished = True
            crc = zlib.crc32(buffer[record.summary_start : position + _HEAD.size + 16])
            if record.summary_crc and crc != record.summary_crc:
                what = "the file's summary does not match its checksum"
                skeleton.damage.append(Damage(position, 0, what))


def _keep(skeleton: Skeleton, known: dict[int, list[T]], record: T, position: int) -> None:
    """Keep the first record of a number, and a later one that differs, which is damage."""
    versions = known.setdefault(record.id, [record])
    if record not in versions:
        versions.append(record)
        what = f"{type(record).__name__.lower()} {record.id} differs from its first record"
        skeleton.damage.append(Damage(position, 0, what))


def _take_attachment(
    skeleton: Skeleton, record: mcap.Attachment, position: int, buffer: memoryview
) -> None:
    first = position + _HEAD.size
    stop = first + int(_HEAD.unpack_from(buffer, position)[1])
    (crc,) = struct.unpack_from("<I", buffer, stop - 4)
    if crc and zlib.crc32(buffer[first : stop - 4]) != crc:
        what = f"attachment {record.name} does not match its checksum"
        skeleton.damage.append(Damage(position, stop - position, what))
        return
    skeleton.attachments.append(record)


def _check_end(skeleton: Skeleton, buffer: memoryview, position: int) -> None:
    if not skeleton.finished:
        skeleton.damage.append(Damage(position, 0, "the file was not finished: it has no footer"))
    elif bytes(buffer[position:]) != MAGIC:
        left = len(buffer) - position
        skeleton.damage.append(Damage(position, left, "the file does not end as MCAP"))
