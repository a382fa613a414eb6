"""Framing: known vectors, independent implementations, and streams cut and damaged anywhere."""

from binascii import crc_hqx
from itertools import pairwise

import numpy as np
import pytest
from cobs import cobs
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers import framing
from drivers.errors import FrameError
from drivers.framing import FrameStream, decode_frames, encode_frame, encode_frames
from drivers.framing_compiled import MAX_BULK_PAYLOAD, MAX_WIRE

SIZE = 42
long_binary = st.one_of(
    st.binary(max_size=40),
    st.binary(min_size=250, max_size=800),
    st.lists(st.sampled_from([0, 1, 255]), min_size=240, max_size=780).map(bytes),
    st.integers(250, 770).map(lambda size: b"\x05" * size),
)
payload_rows = st.integers(0, 12).flatmap(
    lambda n: st.lists(
        st.one_of(
            st.binary(min_size=SIZE, max_size=SIZE),
            st.lists(st.sampled_from([0, 0, 9]), min_size=SIZE, max_size=SIZE).map(bytes),
        ),
        min_size=n,
        max_size=n,
    )
)


def as_rows(payloads: list[bytes]) -> np.ndarray:
    return np.frombuffer(b"".join(payloads), np.uint8).reshape(-1, SIZE)


@given(long_binary)
def test_cobs_and_crc_are_the_published_ones(data):
    assert framing.crc16(b"123456789") == 0x29B1
    assert framing.cobs_encode(data) == cobs.encode(data)
    assert framing.cobs_decode(framing.cobs_encode(data)) == data


@given(long_binary)
def test_cobs_accepts_what_the_cobs_package_accepts(encoded):
    try:
        expected = cobs.decode(encoded)
    except cobs.DecodeError:
        with pytest.raises(FrameError):
            framing.cobs_decode(encoded)
    else:
        assert framing.cobs_decode(encoded) == expected


@given(st.binary(max_size=1024))
def test_a_frame_comes_back(payload):
    frame = encode_frame(payload)
    assert frame.endswith(b"\x00")
    assert 0 not in frame[:-1]
    assert len(frame) <= MAX_WIRE + 1
    assert framing.decode_frame(frame[:-1]) == payload


@given(st.integers(0, MAX_BULK_PAYLOAD), st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_bulk_frames_are_single_frames(size, seed):
    random = np.random.default_rng(seed)
    rows = random.choice(np.array([0, 1, 7, 255], np.uint8), (5, size))
    wire = encode_frames(rows)
    assert wire == b"".join(encode_frame(row.tobytes()) for row in rows)
    decoded = decode_frames(wire, size)
    assert np.array_equal(decoded.payloads, rows)
    assert (decoded.others, decoded.bad, decoded.bad_bytes, decoded.tail) == ([], 0, 0, b"")


@given(payload_rows, st.lists(st.binary(max_size=600), max_size=4), st.randoms())
def test_other_frames_are_handed_back_in_order(rows, others, order):
    others = [payload for payload in others if len(payload) != SIZE]
    turns = [True] * len(rows) + [False] * len(others)
    order.shuffle(turns)
    ours, theirs = iter(rows), iter(others)
    wire = b"".join(encode_frame(next(ours) if turn else next(theirs)) for turn in turns)
    decoded = decode_frames(b"\x00\x00" + wire + b"\x00" + b"\x05half", SIZE)
    assert np.array_equal(decoded.payloads, as_rows(rows))
    assert decoded.others == others
    assert decoded.tail == b"\x05half"
    assert decoded.bad == 0


@given(payload_rows, st.lists(st.integers(0, 700), max_size=8), st.binary(max_size=80))
def test_a_stream_cut_anywhere_decodes_the_same(rows, cuts, noise):
    half = len(rows) // 2
    wire = encode_frames(as_rows(rows[:half])) + noise + b"\x00" + b"\x01" * 1200 + b"\x00"
    wire += encode_frame(b"a reply") + encode_frames(as_rows(rows[half:]))
    whole = FrameStream(SIZE).feed(wire)
    stream = FrameStream(SIZE)
    edges = [0, *sorted(min(cut, len(wire)) for cut in cuts), len(wire)]
    pieces = [stream.feed(wire[a:b]) for a, b in pairwise(edges)]
    assert np.array_equal(np.concatenate([p.payloads for p in pieces]), whole.payloads)
    assert [other for p in pieces for other in p.others] == whole.others
    assert sum(p.bad for p in pieces) == whole.bad
    assert sum(p.bad_bytes for p in pieces) == whole.bad_bytes
    assert whole.bad_bytes >= 1201


@settings(derandomize=True)  # one damaged frame in 65536 has a good CRC by chance
@given(payload_rows.filter(len), st.data())
def test_a_damaged_frame_is_counted_and_its_neighbours_survive(rows, data):
    wire = bytearray(encode_frames(as_rows(rows)))
    frame = SIZE + 4
    index = data.draw(st.integers(0, len(rows) - 1))
    place = index * frame + data.draw(st.integers(0, frame - 2))
    wire[place] ^= data.draw(st.integers(1, 255))
    decoded = decode_frames(bytes(wire), SIZE)
    assert np.array_equal(decoded.payloads, as_rows(rows[:index] + rows[index + 1 :]))
    assert decoded.others == []
    assert decoded.bad in (1, 2)  # a new delimiter makes two pieces of one frame
    assert decoded.bad_bytes in (frame, frame - 1)  # an empty piece is an idle, not a frame


@given(st.binary(max_size=400))
def test_noise_is_decoded_as_one_frame_at_a_time_would(noise):
    good = []
    for piece in noise.split(b"\x00")[:-1]:
        try:
            body = cobs.decode(piece)
        except cobs.DecodeError:
            continue
        if len(body) >= 2 and crc_hqx(body[:-2], 0xFFFF) == int.from_bytes(body[-2:], "little"):
            good.append(body[:-2])
    decoded = decode_frames(noise, 4)
    assert [row.tobytes() for row in decoded.payloads] == [p for p in good if len(p) == 4]
    assert decoded.others == [p for p in good if len(p) != 4]


def test_a_bulk_payload_has_one_code_byte_at_most():
    with pytest.raises(ValueError, match="253"):
        decode_frames(b"", MAX_BULK_PAYLOAD + 1)
