"""The digital F/T's driver and pymodbus' own serial server, on two ends of a pair of terminals.

The server's registers are laid out here by hand, from the public driver `ati_force_torque`: offsets
in registers from the start of a calibration, high byte first.
"""

import json
import os
import pty
import select
import struct
import subprocess
import sys
import threading
import tty
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from drivers.ati_serial.driver import AtiSerial
from drivers.errors import LinkTimeoutError
from drivers.transport.serial_port import open_line

pytestmark = pytest.mark.integration

pytest.importorskip("pymodbus")
BAUD_RATE = 115_200
ROOT = Path(__file__).parents[2]
MATRIX = np.arange(36, dtype=np.float32).reshape(6, 6) * 10 - 100


def registers() -> list[int]:
    """Return 0x200 registers with one calibration at 0x00E3 and a status of 0x0010."""
    words = [0] * 0x200
    words[0x001D] = 0x0010

    def put(offset: int, data: bytes) -> None:
        first = 0x00E3 + offset
        words[first : first + len(data) // 2] = struct.unpack(f">{len(data) // 2}H", data)

    put(0, b"FT12345\0")
    put(4, b"SI-130-10".ljust(32, b"\0"))
    put(32, struct.pack(">36f", *MATRIX.ravel()))
    put(104, bytes([2, 3]))
    put(117, struct.pack(">I", 1_000_000))
    put(119, struct.pack(">I", 500_000))
    put(121, struct.pack(">6H", 540, 541, 542, 543, 544, 545))
    put(127, struct.pack(">6H", 34920, 34921, 34922, 34923, 34924, 34925))
    return words


def relay(one: int, other: int, over: threading.Event) -> None:
    """Carry bytes between the masters of two terminals."""
    while not over.is_set():
        ready, _, _ = select.select([one, other], [], [], 0.05)
        for source in ready:
            os.write(other if source == one else one, os.read(source, 4096))


@pytest.fixture
def line() -> Iterator[str]:
    """A terminal at whose far end pymodbus' server answers."""
    ends = [pty.openpty() for _ in range(2)]
    for _, end in ends:
        tty.setraw(end)
    over = threading.Event()
    thread = threading.Thread(target=relay, args=(ends[0][0], ends[1][0], over))
    thread.start()
    words = [sys.executable, "-m", "tests.drivers.peers.modbus_registers"]
    server = subprocess.Popen(
        [*words, os.ttyname(ends[1][1]), str(BAUD_RATE), "10"],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        with server.stdin as there:
            json.dump(registers(), there)
        assert server.stdout.readline() == "ready\n"
        yield os.ttyname(ends[0][1])
    finally:
        server.kill()
        server.wait()
        server.stdout.close()
        over.set()
        thread.join()
        for master, end in ends:
            os.close(master)
            os.close(end)


def test_a_calibration_is_read_from_pymodbus_server(line):
    device = AtiSerial(open_line(line, BAUD_RATE), rate_hz=100.0)
    identity = None
    while identity is None:
        try:
            identity = device.identify()
        except LinkTimeoutError:
            continue  # the server opens its port when it is ready
    assert identity.model == "ATI digital F/T SI-130-10"
    assert identity.serial == "FT12345"
    tops = [channel.upper for channel in device.channels]
    sums = np.abs(MATRIX).sum(axis=1) * 32768
    assert tops == pytest.approx([*sums[:3] / 1e6, *sums[3:] / 5e5])
    assert device.status() == 0x0010
    device.close()
