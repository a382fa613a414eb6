"""The EPOS4's driver and canopen's server in two processes, over a bus that may lose frames."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from drivers.epos4.driver import Epos4, open_epos4
from drivers.epos4.faults import DriveFaultError
from drivers.errors import DriverError

pytestmark = pytest.mark.integration

CHANNEL = "239.74.163.9"
ROOT = Path(__file__).parents[2]


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("", 0))
        return int(link.getsockname()[1])


@pytest.fixture
def port() -> int:
    number = free_port()
    try:
        can.Bus(interface="udp_multicast", channel=CHANNEL, port=number, fd=False).shutdown()
    except (OSError, can.CanError) as error:
        pytest.skip(f"no multicast between processes here: {error}")
    return number


@pytest.fixture
def drive(port: int) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(
        [sys.executable, "-m", "tests.drivers.peers.epos4_node", CHANNEL, str(port)],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout.readline() == "ready\n"
        yield process
        process.kill()


@pytest.fixture
def device(drive: subprocess.Popen[str], port: int) -> Iterator[Epos4]:
    url = f"can:udp_multicast:{CHANNEL}?port={port}"
    opened = open_epos4(url, rate_hz=100.0, host_timeout_ms=10_000)
    opened.start()
    yield opened
    try:
        opened.close()
    except DriverError:
        assert drive.poll() is not None  # nobody is left to confirm anything


def samples(device: Epos4, count: int) -> None:
    while count > 0:
        count -= len(device.read(0.5))


def test_it_runs_a_torque_and_clears_a_lost_heartbeat(drive, device):
    assert device.identify().model.startswith("maxon EPOS4")
    device.arm()
    device.set_torque(2e-3)
    samples(device, 30)
    drive.stdin.write("8130\n")
    drive.stdin.flush()
    with pytest.raises(DriveFaultError, match="0x8130"):
        samples(device, 10_000)
    assert device.clear_fault() == 0x8130
    device.arm()
    samples(device, 30)
    assert device.last_error == 0


def test_a_drive_whose_process_dies_is_reported(drive, device):
    device.arm()
    samples(device, 10)
    drive.kill()
    with pytest.raises(DriverError, match="fallen silent"):
        samples(device, 10_000)
