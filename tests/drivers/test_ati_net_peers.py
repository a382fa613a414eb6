"""The Net F/T against a sensor and a client that other people wrote: netft-cpp, over real sockets.

Its sources are not part of this project. `RIG_NETFT_CPP` names its archive or its unpacked folder
(0.3.3 was used); without it, or without a C++17 compiler, these tests are skipped.
"""

import os
import shutil
import socket
import subprocess
import tarfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from drivers.ati_net.driver import AtiNet
from drivers.ati_net.fake import RdtFake, fake_calibration
from drivers.device import Batch
from drivers.errors import LinkError, LinkTimeoutError
from drivers.transport import open_transport

SOURCE = os.environ.get("RIG_NETFT_CPP", "")
COMPILER = shutil.which(os.environ.get("CXX", "g++"))
PEERS = Path(__file__).with_name("peers")
pytestmark = [
    pytest.mark.integration,
    pytest.mark.skipif(not SOURCE, reason="RIG_NETFT_CPP names no archive of netft-cpp"),
    pytest.mark.skipif(not COMPILER, reason="no C++ compiler for netft-cpp"),
]
SENSOR = ("test/support/fake_sensor.cpp", "test/support/fake_http_server.cpp")
NOT_OURS = ("discovery.cpp", "udp_transport_windows.cpp")
"""Sources left out of the client: HTTP, which needs libcurl, and another system's sockets."""


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = Path(SOURCE)
    if folder.is_file():
        unpacked = tmp_path_factory.mktemp("netft-cpp")
        with tarfile.open(folder) as archive:
            archive.extractall(unpacked, filter="data")
        folder = unpacked
    return next(folder.rglob("fake_sensor.hpp")).parents[2]


def built(name: str, files: list[Path], sources: Path, to: Path) -> Path:
    """Compile one of the peers and return the program."""
    program = to / name
    includes = [f"-I{sources / folder}" for folder in ("include", "src", "test")]
    words = ["-std=c++17", "-O0", *includes, str(PEERS / f"{name}.cpp"), *map(str, files)]
    assert COMPILER
    subprocess.run([COMPILER, *words, "-pthread", "-o", str(program)], check=True, timeout=300)
    return program


class Sensor:
    """netft-cpp's fake sensor in a process of its own."""

    def __init__(self, program: Path) -> None:
        self.process = subprocess.Popen(
            [str(program)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.port = int(self.process.stdout.readline().split()[0])

    def say(self, line: str) -> None:
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def close(self) -> None:
        self.process.kill()
        self.process.communicate()


@pytest.fixture(scope="module")
def sensor_program(sources: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    files = [sources / name for name in SENSOR]
    return built("netft_sensor", files, sources, tmp_path_factory.mktemp("sensor"))


@pytest.fixture
def sensor(sensor_program: Path) -> Iterator[Sensor]:
    running = Sensor(sensor_program)
    yield running
    running.close()


@pytest.fixture
def device(sensor: Sensor) -> Iterator[AtiNet]:
    transport = open_transport(f"udp:127.0.0.1:{sensor.port}")
    opened = AtiNet(transport, fake_calibration, 1000.0)
    opened.start()
    yield opened
    opened.close()


def some(device: AtiNet, samples: int) -> list[Batch]:
    """Read until that many samples have come; the test's own time limit ends a wait in vain."""
    batches = [device.read(0.5)]
    while sum(map(len, batches)) < samples:
        batches.append(device.read(0.5))
    return batches


def test_its_records_are_read_with_their_values_and_gaps(sensor, device):
    before = some(device, 200)
    last = {name: values[-1] for name, values in before[-1].columns.items()}
    assert list(last.values()) == pytest.approx([100e-6, -200e-6, 300e-6, 10e-6, -20e-6, 30e-6])
    assert (before[-1].flags == 0).all()
    lost = before[-1].lost
    sensor.say("skip 7")
    batches = some(device, 200)
    while batches[-1].lost == lost:
        batches += some(device, 50)
    assert batches[-1].lost == lost + 7
    sequence = np.concatenate([batch.sequence for batch in before + batches])
    assert (np.diff(sequence) > 0).all()


def test_a_bias_does_not_end_its_stream(device):
    some(device, 100)
    device.set_bias()
    some(device, 500)
    device.reset_latch()
    some(device, 500)
    assert device.counters["restarts"] == 0
    assert device.counters["stalls"] == 0


def test_its_silence_and_its_end_are_reported(sensor, device):
    some(device, 100)
    sensor.say("pause")
    with pytest.raises(LinkTimeoutError, match="fallen silent"):  # noqa: PT012
        while True:
            device.read(0.2)
    sensor.say("resume")
    back = 0
    while not back:
        try:
            back += len(device.read(0.2))
        except LinkTimeoutError:
            continue
    sensor.close()
    with pytest.raises(LinkError):  # noqa: PT012
        while True:
            device.read(0.2)


def test_its_client_reads_the_fake_of_this_project(sources, tmp_path):
    files = [path for path in (sources / "src").rglob("*.cpp") if path.name not in NOT_OURS]
    program = built("netft_client", files, sources, tmp_path)
    fake, over = RdtFake(), threading.Event()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        link.settimeout(0.001)
        thread = threading.Thread(target=serve, args=(fake, link, over))
        thread.start()
        try:
            run = subprocess.run(
                [str(program), str(link.getsockname()[1])],
                capture_output=True,
                text=True,
                timeout=60,
                check=True,
            )
        finally:
            over.set()
            thread.join()
    first, counts = run.stdout.splitlines()
    loads = [fake.load(tick) / 1e6 for tick in range(1000)]
    assert any(np.allclose([float(word) for word in first.split()], load) for load in loads)
    came, before, after, faulted = map(int, counts.split())
    assert (came, faulted) == (1, 0)
    assert before > 100
    assert after > before + 100


def serve(fake: RdtFake, link: socket.socket, over: threading.Event) -> None:
    """Let the fake live on a socket at the pace of real time."""
    began_s, ticks, client = time.monotonic(), 0, None
    while not over.is_set():
        try:
            request, client = link.recvfrom(100)
            fake.receive(request)
        except TimeoutError:
            pass
        due = int((time.monotonic() - began_s) * 1000)
        fake.advance(due - ticks)
        ticks = due
        while datagram := fake.transmit():
            link.sendto(datagram, client)
