"""The logger over CAN: the same frames in pieces, by the core and by its twin."""

import ctypes
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import LinkError
from drivers.framing import cobs_encode, encode_frame
from drivers.teensy.can_device import open_teensy_can
from drivers.teensy.can_fake import BoardNode
from drivers.teensy.can_segments import Joiner, Splitter
from drivers.teensy.can_transport import CanTransport
from drivers.teensy.fake import PythonBoard
from drivers.transport.simulated_can import SimulatedCanBus
from rig.bench.session import Session
from rig.simulation.bench import SimulatedBench
from tests.rig.simulated import simulated

pytestmark = pytest.mark.integration

bodies = st.lists(st.binary(min_size=1, max_size=120), min_size=1, max_size=6)


def test_a_short_body_by_the_book() -> None:
    pieces = list(Splitter().split(bytes(range(16))))
    assert [piece.hex() for piece in pieces] == [
        "8000010203040506",
        "010708090a0b0c0d",
        "420e0f",
    ]
    assert next(Splitter().split(b"\x07")).hex() == "c007"


@given(bodies)
def test_what_was_split_is_joined(sent: list[bytes]) -> None:
    splitter, joiner = Splitter(), Joiner()
    got = [b for body in sent for piece in splitter.split(body) for b in joiner.join(piece)]
    assert got == sent


@given(bodies, st.data())
def test_a_lost_piece_spoils_its_frame_alone(sent: list[bytes], data: st.DataObject) -> None:
    splitter, joiner = Splitter(), Joiner()
    pieces = [(k, p) for k, body in enumerate(sent) for p in splitter.split(body)]
    lost = data.draw(st.integers(0, len(pieces) - 1))
    spoilt = pieces[lost][0]
    got = [b for k, (_, p) in enumerate(pieces) if k != lost for b in joiner.join(p)]
    for k, body in enumerate(sent):
        if k != spoilt:
            assert body in got


@given(st.lists(st.binary(max_size=8), max_size=40))
def test_any_pieces_do_no_harm(pieces: list[bytes]) -> None:
    joiner = Joiner()
    for piece in pieces:
        joiner.join(piece)


def in_rows(pieces: list[bytes]) -> bytes:
    return b"".join(bytes([len(p)]) + p.ljust(8, b"\0") for p in pieces)


@given(payloads=st.lists(st.binary(min_size=1, max_size=200), min_size=1, max_size=5))
def test_the_core_cuts_and_joins_alike(library: Path, payloads: list[bytes]) -> None:
    core = ctypes.CDLL(str(library))
    core.rig_can_split.restype = core.rig_can_join.restype = ctypes.c_size_t
    wire = b"".join(encode_frame(payload) for payload in payloads)
    out = ctypes.create_string_buffer(20000)
    count = core.rig_can_split(wire, ctypes.c_size_t(len(wire)), out, ctypes.c_size_t(20000))
    rows = ctypes.string_at(out, 9 * count)
    theirs = [rows[k + 1 : k + 1 + rows[k]] for k in range(0, len(rows), 9)]
    splitter, joiner = Splitter(), Joiner()
    ours = [p for payload in payloads for p in splitter.split(body_of(payload))]
    assert theirs == ours
    used = core.rig_can_join(in_rows(ours), ctypes.c_size_t(len(ours)), out, ctypes.c_size_t(20000))
    joined = b"".join(cobs_encode(b) + b"\0" for p in ours for b in joiner.join(p))
    assert ctypes.string_at(out, used) == joined == wire


def body_of(payload: bytes) -> bytes:
    from drivers.framing import CRC_SIZE, crc16

    return payload + crc16(payload).to_bytes(CRC_SIZE, "little")


def test_a_session_runs_over_can_unchanged() -> None:
    config = simulated()
    node = BoardNode(PythonBoard(SimulatedBench()))
    with Session(config, CanTransport(SimulatedCanBus([node]))) as session:
        session.take_zeros(0.3)
        readings = list(session.play(np.linspace(-1.0, -0.9, 300), np.zeros(300)))
        assert session.counters["crc_errors"] == 0
    setpoint = np.concatenate([r.setpoint for r in readings])
    assert np.array_equal(setpoint[setpoint >= 0], np.arange(300))
    assert readings[-1].lost == 0


@pytest.mark.parametrize("ids", [(0x690, 0x690), (0, 0x6A0), (0x690, 0x800)])
def test_identifiers_that_cannot_be_are_refused(ids: tuple[int, int]) -> None:
    with pytest.raises(LinkError, match="identifiers"):
        open_teensy_can("can:virtual:x", *ids)
