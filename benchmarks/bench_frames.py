"""Bulk decode of sample frames against a Python loop over them."""

import struct
from binascii import crc_hqx

import numpy as np
from cobs import cobs
from numpy.typing import NDArray

from benchmarks.ratio import Ratio, best_of
from drivers.framing import decode_frames, encode_frames
from drivers.teensy.reference import SAMPLE_DTYPE

FRAMES = 60_000
"""One minute at 1 kHz."""
_SAMPLE = struct.Struct("<BBHIIiiiihhhHhhH")


def measure() -> list[Ratio]:
    """Decode the same minute of stream both ways, to the same structured array.

    The baseline is a plain loop: `bytes.split` at the delimiters (C), `cobs.decode` (the cobs
    package, C), `binascii.crc_hqx` (C) and `struct.Struct.unpack` a frame, and one `numpy.array` of
    the tuples at the end.
    """
    stream = device_stream()
    if not np.array_equal(_by_loop(stream), _in_bulk(stream)):
        raise AssertionError("the two ways decode different samples")
    loop_s = best_of(lambda: _by_loop(stream))
    bulk_s = best_of(lambda: _in_bulk(stream), repeats=10)
    detail = f"{bulk_s / FRAMES * 1e9:.0f} ns a frame, loop {loop_s / FRAMES * 1e9:.0f} ns"
    return [Ratio("bulk frame decode over a cobs loop", loop_s / bulk_s, 20.0, detail=detail)]


def device_stream() -> bytes:
    """Return a minute of samples that look like the rig's: many counters, small torques."""
    ticks = np.arange(FRAMES)
    random = np.random.default_rng(1)
    samples = np.zeros(FRAMES, SAMPLE_DTYPE)
    samples["version"], samples["kind"], samples["status"] = 1, 1, 1
    samples["sequence"], samples["tick_us"] = ticks, 1000 * ticks
    sweep = np.sin(2 * np.pi * 0.3e-3 * ticks)
    samples["motor"] = 17.5 * 1300 * sweep
    samples["spindle"] = samples["target"] = -1300 * sweep
    samples["jaw"] = 400 * sweep
    for name, size in (("proximal", 5000), ("distal", -4000), ("current", 300)):
        samples[name] = size * sweep + random.normal(0, 5, FRAMES)
    samples["command_e4"] = -1500 * sweep
    samples["load_ma"] = 400
    return encode_frames(samples.view(np.uint8).reshape(FRAMES, -1))


def _in_bulk(stream: bytes) -> NDArray[np.void]:
    samples: NDArray[np.void] = decode_frames(stream, SAMPLE_DTYPE.itemsize).payloads.view(
        SAMPLE_DTYPE
    )[:, 0]
    return samples


def _by_loop(stream: bytes) -> NDArray[np.void]:
    rows = []
    for frame in stream.split(b"\x00"):
        if not frame:
            continue
        try:
            body = cobs.decode(frame)
        except cobs.DecodeError:
            continue
        payload = body[:-2]
        if crc_hqx(payload, 0xFFFF) == int.from_bytes(body[-2:], "little"):
            rows.append(_SAMPLE.unpack(payload))
    return np.array(rows, SAMPLE_DTYPE)
