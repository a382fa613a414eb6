"""The logger's layouts: fixed sizes and offsets, round trips, and refusal of anything else."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from drivers.errors import FrameError
from drivers.teensy import protocol
from drivers.teensy.protocol import Kind
from drivers.teensy.reference import REFERENCE, SAMPLE_DTYPE, SETPOINT_DTYPE

ROOT = Path(__file__).parents[2]


def test_the_sample_is_laid_out_as_documented_and_no_other_frame_has_its_size():
    layout = SAMPLE_DTYPE
    assert layout.itemsize == 42
    offsets = {name: layout.fields[name][1] for name in layout.names}
    assert list(offsets.values()) == [0, 1, 2, 4, 8, 12, 16, 20, 24, 28, 30, 32, 34, 36, 38, 40]
    assert all(layout[name].str[0] in "<|" for name in layout.names)
    others = [item.itemsize for kind, item in REFERENCE.layouts.items() if kind != Kind.SAMPLE]
    assert 42 not in others
    assert (42 - 4) % SETPOINT_DTYPE.itemsize


def test_an_unknown_trip_is_refused():
    fields = REFERENCE.decode(protocol.encode(Kind.TRIP_REPORT, 1, 99, 255, 0, 0, 0, 0))[2]
    with pytest.raises(FrameError, match="99"):
        REFERENCE.decode_trip_report(fields)


@pytest.mark.parametrize(
    "payload",
    [
        b"\x01\x10\x00",
        b"\x02\x10\x00\x00",
        b"\x01\x63\x00\x00",
        b"\x01\x10\x00\x00\x00",
        protocol.encode(Kind.SETPOINTS, 1, 0),
        protocol.encode(Kind.SETPOINTS, 1, 0) + bytes(5),
        protocol.encode(Kind.SETPOINTS, 1, 0) + bytes(606),
        bytes([1, Kind.SAMPLE]) + bytes(40),
    ],
    ids=["short", "version", "kind", "long", "none", "part", "many", "sample"],
)
def test_anything_else_is_refused(payload):
    with pytest.raises(FrameError):
        REFERENCE.decode(payload)


def test_the_boards_header_is_the_one_made_from_these_tables():
    done = subprocess.run(
        [sys.executable, "-c", "import contract; print(contract.header(), end='')"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "firmware")])},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == (ROOT / "firmware" / "core" / "contract.hpp").read_text()
