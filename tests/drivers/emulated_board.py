"""The firmware on an emulated Cortex-M4: QEMU, its serial line on a loopback port.

The board's time passes only as it is asked for ticks (firmware/boards/mps2/hardware.hpp), so that
nothing here depends on how fast the emulator gets on.
"""

import shutil
import socket
import struct
import subprocess
from pathlib import Path

from drivers.device import Device
from drivers.teensy.device import TeensyDevice
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import SimulatedTransport

PROGRAM = Path(__file__).parents[2] / "firmware" / "build" / "rig_firmware_arm.elf"
EMULATOR = "qemu-system-arm"
MISSING = (
    f"{EMULATOR} is not installed; see make firmware-arm"
    if shutil.which(EMULATOR) is None
    else "not built; run: make firmware-arm"
    if not PROGRAM.is_file()
    else ""
)
"""Why the emulated board cannot be tried here; empty where it can."""
SILENT_S = 120.0
"""An emulator that is silent for so long has crashed."""


class EmulatedBoard:
    """An emulator that it starts; implements `drivers.transport.simulated.Board`."""

    def __init__(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as server:
            server.settimeout(SILENT_S)
            port = server.getsockname()[1]
            words = [EMULATOR, "-M", "mps2-an386", "-display", "none", "-monitor", "none"]
            words += ["-serial", f"tcp:127.0.0.1:{port},nodelay=on", "-kernel", str(PROGRAM)]
            self._emulator = subprocess.Popen(words)
            try:
                self._line, _ = server.accept()
            except BaseException:
                self._end()
                raise
        self._line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._line.settimeout(SILENT_S)
        self._answers = self._line.makefile("rb")
        self._waiting = b""

    def receive(self, data: bytes) -> None:
        self._turn(0, data)

    def advance(self, ticks: int) -> None:
        self._turn(ticks, b"")

    def transmit(self) -> bytes:
        waiting, self._waiting = self._waiting, b""
        return waiting

    def close(self) -> None:
        self._answers.close()
        self._line.close()
        self._end()

    def _turn(self, ticks: int, data: bytes) -> None:
        self._line.sendall(struct.pack("<HH", ticks, len(data)) + data)
        while size := struct.unpack("<H", self._answers.read(2))[0]:
            self._waiting += self._answers.read(size)

    def _end(self) -> None:
        self._emulator.kill()
        self._emulator.wait()


class EmulatedLine(SimulatedTransport):
    """A transport to an emulated board, which ends with it."""

    def close(self) -> None:
        super().close()
        self.board.close()


def open_fake(faults: Faults) -> Device:
    """Open the logger's driver on an emulated board behind a cable with faults."""
    return TeensyDevice(FaultyTransport(EmulatedLine(EmulatedBoard(), "sim://cortex-m4"), faults))
