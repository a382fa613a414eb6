"""Unpacking chunks into arrays.

A chunk of one stream of fixed-size messages is, unpacked, an array of records, and is read as one.
The message index behind a chunk identifies such chunks; that is checked against every record. A
chunk in which other records stand between (another writer's), or a damaged one, is read record by
record. Chunks are independent, so they are unpacked on several threads.
"""

import os
import struct
import zlib
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import zstandard
from numpy.typing import NDArray

from rig.errors import DataError
from rig.log.scan import ChunkRef, Damage
from rig.log.schema import CDR_HEADER, MESSAGE_OPCODE, Stream

BATCH_BYTES = 1 << 19
"""Unpacked bytes a thread takes at a time: it fits in a core's cache, and hides the hand-over."""

MAX_CHUNK_BYTES = 1 << 30
"""A chunk that states more than this is taken for damaged, not unpacked."""

_MESSAGE = struct.Struct("<BQH")


@dataclass(frozen=True)
class Layout:
    """Layout of a message record of one channel."""

    topic: str
    stream: Stream

    @cached_property
    def record(self) -> np.dtype[np.void]:
        """NumPy type of a whole record."""
        return self.stream.record_dtype

    @cached_property
    def length(self) -> int:
        """Length a record states."""
        return self.stream.record_length

    @cached_property
    def size(self) -> int:
        """Bytes of a whole record."""
        return self.record.itemsize


@dataclass
class Found:
    """Messages of the wanted channels, and what is damaged.

    Attributes:
        rows: Channel to fields, structured array of the stream's dtype, shape (n,), in file order.
        log_time_ns: Channel to log times, ns, shape (n,).
        damage: Chunks that could not be read.
        salvaged: Channel to the number of its messages that come from a torn chunk.
    """

    rows: dict[int, NDArray[np.void]] = field(default_factory=dict)
    log_time_ns: dict[int, NDArray[np.uint64]] = field(default_factory=dict)
    damage: list[Damage] = field(default_factory=list)
    salvaged: dict[int, int] = field(default_factory=dict)


@dataclass(frozen=True)
class _Target:
    """Where the messages of one channel go, as raw bytes of each row and as log times."""

    rows: NDArray[np.uint8]
    log_time_ns: NDArray[np.uint64]

    def part(self, first: int, stop: int) -> "_Target":
        return _Target(self.rows[first:stop], self.log_time_ns[first:stop])


@dataclass(frozen=True)
class _Batch:
    """Neighbouring chunks; with a channel, if they hold messages of that one and nothing else."""

    chunks: list[ChunkRef]
    channel: int | None
    target: _Target | None


@dataclass
class _Read:
    """Result of a batch."""

    pieces: list[tuple[int, _Target]] = field(default_factory=list)
    damage: list[Damage] = field(default_factory=list)
    salvaged: dict[int, int] = field(default_factory=dict)


def read_chunks(
    buffer: memoryview, chunks: list[ChunkRef], layouts: dict[int, Layout], wanted: set[int]
) -> Found:
    """Unpack chunks and gather the messages of the wanted channels.

    Args:
        buffer: The bytes of the file.
        chunks: Its chunks, in file order.
        layouts: Layout of each channel of fixed size.
        wanted: Channels to read, keys of `layouts`.
    """
    found = Found()
    if not wanted:
        return found
    targets, batches = _plan(chunks, layouts, wanted)
    threads = max(1, min(len(batches), os.cpu_count() or 1))
    with ThreadPoolExecutor(threads) as pool:
        done = list(pool.map(lambda batch: _read_batch(buffer, batch, layouts, wanted), batches))
    for channel in wanted:
        whole = _joined(
            targets[channel],
            [piece for read in done for number, piece in read.pieces if number == channel],
        )
        found.rows[channel] = whole.rows.view(layouts[channel].stream.dtype)[:, 0]
        found.log_time_ns[channel] = whole.log_time_ns
    for read in done:
        found.damage += read.damage
        found.salvaged |= read.salvaged
    return found


def _plan(
    chunks: list[ChunkRef], layouts: dict[int, Layout], wanted: set[int]
) -> tuple[dict[int, _Target], list[_Batch]]:
    """Divide the chunks among batches and give each batch its place in the result."""
    owners = [_owner(chunk, layouts) for chunk in chunks]
    counts = dict.fromkeys(wanted, 0)
    for chunk, owner in zip(chunks, owners, strict=True):
        if owner in wanted:
            counts[owner] += chunk.unpacked_bytes // layouts[owner].size
    targets = {
        channel: _Target(
            np.empty((count, layouts[channel].stream.dtype.itemsize), np.uint8),
            np.empty(count, np.uint64),
        )
        for channel, count in counts.items()
    }
    placed = dict.fromkeys(wanted, 0)
    gathered: dict[int | None, list[ChunkRef]] = defaultdict(list)
    gathered_bytes: dict[int | None, int] = defaultdict(int)
    batches: list[_Batch] = []

    def send(owner: int | None) -> None:
        batch = gathered.pop(owner, [])
        size = gathered_bytes.pop(owner, 0)
        if not batch:
            return
        target = None
        if owner is not None:
            first = placed[owner]
            placed[owner] += size // layouts[owner].size
            target = targets[owner].part(first, placed[owner])
        batches.append(_Batch(batch, owner, target))

    for chunk, owner in zip(chunks, owners, strict=True):
        if owner is None:
            for other in list(gathered):  # so that each channel's messages stay in file order
                send(other)
        elif owner not in wanted:
            continue
        gathered[owner].append(chunk)
        gathered_bytes[owner] += chunk.unpacked_bytes
        if gathered_bytes[owner] > BATCH_BYTES:
            send(owner)
    for owner in list(gathered):
        send(owner)
    return targets, batches


def _owner(chunk: ChunkRef, layouts: dict[int, Layout]) -> int | None:
    """Return the one channel in a chunk's index, if the sizes confirm it."""
    if chunk.torn or len(chunk.indexed) != 1:
        return None
    ((channel, count),) = chunk.indexed.items()
    if channel not in layouts or count * layouts[channel].size != chunk.unpacked_bytes:
        return None
    return channel


def _joined(target: _Target, pieces: list[_Target]) -> _Target:
    """Return the pieces as one; without a copy where they fill the target in its own order."""
    if sum(len(piece.rows) for piece in pieces) == len(target.rows) and all(
        piece.rows.base is target.rows for piece in pieces
    ):
        return target
    return _Target(
        np.concatenate([target.rows[:0], *(piece.rows for piece in pieces)]),
        np.concatenate([target.log_time_ns[:0], *(piece.log_time_ns for piece in pieces)]),
    )


def _read_batch(
    buffer: memoryview, batch: _Batch, layouts: dict[int, Layout], wanted: set[int]
) -> _Read:
    if batch.channel is not None and batch.target is not None:
        try:
            _read_array(buffer, batch.chunks, batch.channel, layouts[batch.channel], batch.target)
        except (DataError, zstandard.ZstdError):
            pass  # one of the chunks does not match its index: take them one at a time
        else:
            return _Read([(batch.channel, batch.target)])
    return _read_singly(buffer, batch.chunks, layouts, wanted)


def _read_array(
    buffer: memoryview, chunks: list[ChunkRef], channel: int, layout: Layout, target: _Target
) -> None:
    """Read chunks that hold messages of one channel only, as one array.

    Raises:
        DataError: A chunk is damaged, or holds something else.
        zstandard.ZstdError: A chunk cannot be unpacked.
    """
    decompressor = zstandard.ZstdDecompressor()
    data = b"".join([_unpack(buffer, chunk, decompressor) for chunk in chunks])
    records = np.frombuffer(data, layout.record)
    if not (
        (records["opcode"] == MESSAGE_OPCODE).all()
        and (records["length"] == layout.length).all()
        and (records["channel"] == channel).all()
        and (records["cdr"] == CDR_HEADER).all()
    ):
        raise DataError("The chunks hold other records too.")
    raw = np.frombuffer(data, np.uint8).reshape(len(records), layout.size)
    target.rows[:] = raw[:, layout.size - layout.stream.dtype.itemsize :]
    target.log_time_ns[:] = records["log_time"]


def _read_singly(
    buffer: memoryview, chunks: list[ChunkRef], layouts: dict[int, Layout], wanted: set[int]
) -> _Read:
    """Read chunks record by record, leaving out the damaged ones."""
    read = _Read()
    decompressor = zstandard.ZstdDecompressor()
    for chunk in chunks:
        try:
            data = _unpack(buffer, chunk, decompressor)
        except (DataError, zstandard.ZstdError) as error:
            what = f"a chunk cannot be unpacked: {error}"
            read.damage.append(Damage(chunk.offset, len(chunk.data), what))
            continue
        pieces, problem = _walk(data, layouts, wanted)
        read.pieces += pieces
        if chunk.torn:
            read.salvaged |= {channel: len(piece.rows) for channel, piece in pieces}
        elif problem:
            read.damage.append(Damage(chunk.offset, len(chunk.data), problem))
    return read


def _unpack(buffer: memoryview, chunk: ChunkRef, decompressor: zstandard.ZstdDecompressor) -> bytes:
    """Return a chunk's bytes, checked; of a torn chunk, those that can be had.

    Raises:
        DataError: The chunk does not match its checksum or its size.
        zstandard.ZstdError: It cannot be unpacked.
    """
    packed = buffer[chunk.data.start : chunk.data.stop]
    if chunk.compression == "lz4":
        raise DataError("it is compressed with lz4, which is not supported")
    if chunk.torn:
        salvage = decompressor.decompressobj().decompress
        return salvage(packed) if chunk.compression else bytes(packed)
    if chunk.compression:
        stated = zstandard.frame_content_size(packed)
        if stated != chunk.unpacked_bytes or stated > MAX_CHUNK_BYTES:
            raise DataError(f"it states sizes of {chunk.unpacked_bytes} and {stated} bytes")
        data = decompressor.decompress(packed)
    else:
        data = bytes(packed)
    if len(data) != chunk.unpacked_bytes:
        raise DataError(f"it holds {len(data)} bytes, not {chunk.unpacked_bytes}")
    if chunk.crc and zlib.crc32(data) != chunk.crc:
        raise DataError("it does not match its checksum")
    return data


def _walk(
    data: bytes, layouts: dict[int, Layout], wanted: set[int]
) -> tuple[list[tuple[int, _Target]], str | None]:
    """Read a chunk record by record; stop with the reason where that is not possible."""
    places: dict[int, list[int]] = defaultdict(list)
    position, problem = 0, None
    while position < len(data):
        if position + _MESSAGE.size > len(data):
            problem = "a chunk ends inside a record"
            break
        opcode, length, channel = _MESSAGE.unpack_from(data, position)
        stop = position + 9 + length
        if stop > len(data):
            problem = "a chunk ends inside a record"
            break
        if opcode == MESSAGE_OPCODE and channel in layouts:
            if length != layouts[channel].length:
                problem = f"a message of {layouts[channel].topic} has a wrong length"
                break
            places[channel].append(position)
        position = stop
    pieces = []
    array = np.frombuffer(data, np.uint8)
    for channel in sorted(places.keys() & wanted):
        layout = layouts[channel]
        windows = np.lib.stride_tricks.sliding_window_view(array, layout.size)
        raw = windows[places[channel]]
        records = raw.view(layout.record)[:, 0]
        if (records["cdr"] != CDR_HEADER).any():
            problem = f"a message of {layout.topic} is not little-endian CDR"
            continue
        payload = np.ascontiguousarray(raw[:, layout.size - layout.stream.dtype.itemsize :])
        pieces.append((channel, _Target(payload, records["log_time"].copy())))
    return pieces, problem
