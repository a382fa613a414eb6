"""The logger's layouts: fixed sizes and offsets, round trips, and refusal of anything else."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import FrameError
from drivers.teensy import protocol
from drivers.teensy.protocol import Ack, Kind, Trip
from drivers.teensy.reference import LIMIT_NAMES, REFERENCE, SAMPLE_DTYPE, SETPOINT_DTYPE, Limits

ROOT = Path(__file__).parents[2]
u16 = st.integers(0, 2**16 - 1)
i32 = st.integers(-(2**31), 2**31 - 1)


def test_the_sample_is_laid_out_as_documented() -> None:
    layout = SAMPLE_DTYPE
    assert layout.itemsize == 42
    offsets = {name: layout.fields[name][1] for name in layout.names}
    assert list(offsets.values()) == [0, 1, 2, 4, 8, 12, 16, 20, 24, 28, 30, 32, 34, 36, 38, 40]
    assert all(layout[name].str[0] in "<|" for name in layout.names)


def test_no_other_frame_has_the_size_of_a_sample() -> None:
    layouts = {kind: layout for kind, layout in REFERENCE.layouts.items() if kind != Kind.SAMPLE}
    assert SAMPLE_DTYPE.itemsize not in {item.itemsize for item in layouts.values()}
    assert (SAMPLE_DTYPE.itemsize - 4) % SETPOINT_DTYPE.itemsize


def test_the_text_names_every_kind() -> None:
    lines = REFERENCE.text.splitlines()
    assert [line.split(":")[0] for line in lines[2:-3]] == [f"{k} {k.name}" for k in Kind]


@given(
    u16,
    st.lists(st.floats(-1e6, 1e6), min_size=5, max_size=5),
    st.tuples(*[i32] * len(LIMIT_NAMES)),
)
def test_arm_comes_back(sequence: int, gains: list[float], limits: tuple[int, ...]) -> None:
    payload = REFERENCE.encode_arm(sequence, np.array(gains), Limits(*limits), 2**32 - 5)
    kind, number, fields = REFERENCE.decode(payload)
    assert (kind, number) == (Kind.ARM, sequence)
    assert fields["session"] == 2**32 - 5
    assert [float(fields[name]) for name in protocol.GAIN_NAMES] == gains
    assert tuple(int(fields[name]) for name in LIMIT_NAMES) == limits


@given(u16, st.sampled_from(list(Trip)), i32, i32, st.integers(0, 2**32 - 1))
def test_a_trip_report_comes_back(sequence: int, code: Trip, value: int, limit: int, at: int):
    payload = protocol.encode_trip_report(sequence, code, 3, (value, limit, at, 2**40))
    report = REFERENCE.decode_trip_report(REFERENCE.decode(payload)[2])
    assert report == protocol.TripReport(code, "proximal", value, limit, at, 2**32 - 1)


def test_an_unknown_trip_is_refused() -> None:
    fields = REFERENCE.decode(protocol.encode_trip_report(1, 99, 255, (0, 0, 0, 0)))[2]
    with pytest.raises(FrameError, match="99"):
        REFERENCE.decode_trip_report(fields)


@given(u16, st.lists(st.tuples(i32, st.integers(-(2**15), 2**15 - 1)), min_size=1, max_size=100))
def test_setpoints_come_back(sequence: int, setpoints: list[tuple[int, int]]) -> None:
    targets, loads = (np.array(values) for values in zip(*setpoints, strict=True))
    payload = REFERENCE.encode_setpoints(sequence, (targets, loads), 77)
    assert REFERENCE.decode(payload)[:2] == (Kind.SETPOINTS, sequence)
    assert REFERENCE.decode_setpoints(payload).tolist() == setpoints


@given(u16, st.sampled_from(list(Kind)), st.integers(0, 6), u16, u16)
def test_an_ack_comes_back(sequence: int, command: Kind, result: int, status: int, free: int):
    ack = Ack(sequence, command, result, status, free)
    assert protocol.decode_ack(REFERENCE.decode(protocol.encode_ack(ack))[2]) == ack


def test_identity_and_pong_come_back() -> None:
    version = protocol.version_text(protocol.FIRMWARE_VERSION)
    sent = protocol.Identity("TEENSY-0042", version, REFERENCE.protocol_hash, 7, 2, 3, 4)
    fields = REFERENCE.decode(protocol.encode_hello_reply(9, sent))[2]
    assert protocol.decode_identity(fields) == sent
    kind, sequence, pong = REFERENCE.decode(protocol.encode_pong(5, 2**64 - 1, 2**32 - 1))
    assert (kind, sequence) == (Kind.PONG, 5)
    assert (int(pong["token"]), int(pong["tick_us"])) == (2**64 - 1, 2**32 - 1)


@pytest.mark.parametrize(
    "payload",
    [
        b"\x01\x10\x00",
        b"\x02\x10\x00\x00",
        b"\x01\x63\x00\x00",
        b"\x01\x10\x00\x00\x00",
        protocol.encode_command(Kind.SETPOINTS, 1),
        protocol.encode_command(Kind.SETPOINTS, 1) + bytes(5),
        protocol.encode_command(Kind.SETPOINTS, 1) + bytes(606),
        bytes([1, Kind.SAMPLE]) + bytes(40),
    ],
    ids=["short", "version", "kind", "long", "none", "part", "many", "sample"],
)
def test_anything_else_is_refused(payload: bytes) -> None:
    with pytest.raises(FrameError):
        REFERENCE.decode(payload)


def test_the_boards_header_is_the_one_made_from_these_tables() -> None:
    done = subprocess.run(
        [sys.executable, "-c", "import contract; print(contract.header(), end='')"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "firmware")])},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == (ROOT / "firmware" / "core" / "contract.hpp").read_text()
