"""The firmware on an emulated Cortex-M4: QEMU, its serial line on a loopback port."""

import shutil
import socket
import subprocess
from pathlib import Path
from time import monotonic, sleep

from drivers.device import Device
from drivers.errors import LinkError
from drivers.teensy.device import TeensyDevice
from drivers.transport import Transport, open_transport
from drivers.transport.faulty import Faults, FaultyTransport

PROGRAM = Path(__file__).parents[2] / "firmware" / "build" / "rig_firmware_arm.elf"
EMULATOR = "qemu-system-arm"
STARTS_S = 10.0
MISSING = (
    f"{EMULATOR} is not installed; see make firmware-arm"
    if shutil.which(EMULATOR) is None
    else "not built; run: make firmware-arm"
    if not PROGRAM.is_file()
    else ""
)
"""Why the emulated board cannot be tried here; empty where it can."""


class EmulatedBoard:
    """A transport to an emulated board that it starts, and ends when it is closed."""

    def __init__(self) -> None:
        port = _free_port()
        words = [EMULATOR, "-M", "mps2-an386", "-display", "none", "-monitor", "none"]
        serial = ["-serial", f"tcp:127.0.0.1:{port},server,nowait,nodelay"]
        self._emulator = subprocess.Popen([*words, *serial, "-kernel", str(PROGRAM)])
        try:
            self._line = _open(f"socket://127.0.0.1:{port}")
        except BaseException:
            self._end()
            raise

    @property
    def url(self) -> str:
        return self._line.url

    @property
    def now_s(self) -> float:
        return self._line.now_s

    def read(self, timeout_s: float) -> bytes:
        return self._line.read(timeout_s)

    def write(self, data: bytes) -> None:
        self._line.write(data)

    def close(self) -> None:
        self._line.close()
        self._end()

    def _end(self) -> None:
        self._emulator.kill()
        self._emulator.wait()


def open_fake(faults: Faults) -> Device:
    """Open the logger's driver on an emulated board behind a cable with faults."""
    return TeensyDevice(FaultyTransport(EmulatedBoard(), faults))


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def _open(url: str) -> Transport:
    """Open the line as soon as the emulator listens."""
    give_up_s = monotonic() + STARTS_S
    while True:
        try:
            return open_transport(url)
        except LinkError:
            if monotonic() > give_up_s:
                raise
            sleep(0.02)
