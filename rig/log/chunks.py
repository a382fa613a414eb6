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
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import zstandard
from numpy.typing import NDArray

from rig.errors import DataError
from rig.log.scan import ChunkRef, Damage
from rig.log.schema import CDR_HEADER, MESSAGE_HEAD_BYTES, MESSAGE_OPCODE, Stream

BATCH_BYTES = 1 << 19
"""Unpacked bytes a thread takes at a time: they fit in a core's cache."""

MAX_CHUNK_BYTES = 1 << 30
"""A chunk that states more than this is taken for damaged, not unpacked."""

MIXED = -1
"""In place of a channel: a chunk in which several may be."""

_MESSAGE = struct.Struct("<BQH")
_CDR = CDR_HEADER.to_bytes(4, "little")


Bytes = NDArray[np.uint8]


@dataclass
class Found:
    """Messages of the wanted channels, and what is damaged."""

    # channel to the bytes of its message records, in file order
    data: dict[int, Bytes] = field(default_factory=dict)
    damage: list[Damage] = field(default_factory=list)  # chunks that could not be read
    # channel to the number of its messages that come from a torn chunk
    salvaged: dict[int, int] = field(default_factory=dict)


def read_chunks(
    buffer: memoryview, chunks: Sequence[ChunkRef], streams: dict[int, Stream], wanted: set[int]
) -> Found:
    """Unpack the chunks of a file, in file order, and gather the messages of the wanted channels.

    `streams` has the stream of each channel of fixed size; the wanted ones are keys of it.
    """
    batches: dict[int, list[ChunkRef]] = defaultdict(list)
    before = 0
    for chunk in chunks if wanted else ():
        if _owner(chunk, streams) in (MIXED, *wanted):
            batches[before // BATCH_BYTES].append(chunk)
            before += chunk.unpacked_bytes
    threads = max(1, min(len(batches), os.cpu_count() or 1))
    with ThreadPoolExecutor(threads) as pool:
        work = partial(_read_batch, buffer, streams=streams, wanted=wanted)
        done = list(pool.map(work, batches.values()))
    found = Found()
    for channel in wanted:
        pieces = [read.data[channel] for read in done if channel in read.data]
        found.data[channel] = np.concatenate([np.empty(0, np.uint8), *pieces])
    for read in done:
        found.damage += read.damage
        found.salvaged |= read.salvaged
    return found


def _owner(chunk: ChunkRef, streams: dict[int, Stream]) -> int:
    """Return the one channel in a chunk's index, if the sizes confirm it."""
    if chunk.torn or len(chunk.indexed) != 1:
        return MIXED
    ((channel, count),) = chunk.indexed.items()
    if channel not in streams:
        return MIXED
    size = streams[channel].record_dtype.itemsize
    return channel if count * size == chunk.unpacked_bytes else MIXED


def _read_batch(
    buffer: memoryview, batch: list[ChunkRef], streams: dict[int, Stream], wanted: set[int]
) -> Found:
    try:
        return Found(_read_arrays(buffer, batch, streams))
    except (DataError, zstandard.ZstdError):  # a chunk does not match its index: one at a time
        return _read_singly(buffer, batch, streams, wanted)


def _read_arrays(
    buffer: memoryview, batch: list[ChunkRef], streams: dict[int, Stream]
) -> dict[int, Bytes]:
    """Read chunks that hold messages of one channel each; an error where one does not."""
    parts: dict[int, list[bytes]] = defaultdict(list)
    decompressor = zstandard.ZstdDecompressor()
    for chunk in batch:
        if (channel := _owner(chunk, streams)) == MIXED:
            raise DataError("A chunk may hold several channels.")
        parts[channel].append(_unpack(buffer, chunk, decompressor))
    read = {channel: np.frombuffer(b"".join(data), np.uint8) for channel, data in parts.items()}
    for channel, content in read.items():
        records = content.view(streams[channel].record_dtype)
        if not (
            (records["opcode"] == MESSAGE_OPCODE).all()
            and (records["length"] == streams[channel].record_length).all()
            and (records["channel"] == channel).all()
            and (records["cdr"] == CDR_HEADER).all()
        ):
            raise DataError("The chunks hold other records too.")
    return read


def _read_singly(
    buffer: memoryview, chunks: list[ChunkRef], streams: dict[int, Stream], wanted: set[int]
) -> Found:
    """Read chunks record by record, leaving out the damaged ones."""
    read = Found()
    decompressor = zstandard.ZstdDecompressor()
    parts: dict[int, list[bytes]] = defaultdict(list)
    for chunk in chunks:
        try:
            data = _unpack(buffer, chunk, decompressor)
        except (DataError, zstandard.ZstdError) as error:
            what = f"a chunk cannot be unpacked: {error}"
            read.damage.append(Damage(chunk.offset, len(chunk.data), what))
            continue
        records, problem = _walk(data, streams)
        for channel in records.keys() & wanted:
            parts[channel] += records[channel]
            if chunk.torn:
                read.salvaged[channel] = len(records[channel])
        if problem and not chunk.torn:
            read.damage.append(Damage(chunk.offset, len(chunk.data), problem))
    read.data = {n: np.frombuffer(b"".join(data), np.uint8) for n, data in parts.items()}
    return read


def _unpack(buffer: memoryview, chunk: ChunkRef, decompressor: zstandard.ZstdDecompressor) -> bytes:
    """Return a chunk's bytes, checked by size and sum; of a torn chunk, those that can be had."""
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


def _walk(data: bytes, streams: dict[int, Stream]) -> tuple[dict[int, list[bytes]], str | None]:
    """Read a chunk record by record; stop with the reason where that is not possible."""
    found: dict[int, list[bytes]] = defaultdict(list)
    position, problem = 0, None
    while position < len(data):
        stop = position + _MESSAGE.size
        if stop <= len(data):
            opcode, length, channel = _MESSAGE.unpack_from(data, position)
            stop = position + 9 + length
        if stop > len(data):
            return found, "a chunk ends inside a record"
        if opcode == MESSAGE_OPCODE and channel in streams:
            topic, record = streams[channel].topic, data[position:stop]
            if length != streams[channel].record_length:
                return found, f"a message of {topic} has a wrong length"
            if record.startswith(_CDR, 9 + MESSAGE_HEAD_BYTES):
                found[channel].append(record)
            else:
                problem = f"a message of {topic} is not little-endian CDR"
        position = stop
    return found, problem
