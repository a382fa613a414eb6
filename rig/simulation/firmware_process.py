"""The firmware as a process of its own, in real time, at the other end of a pseudo-terminal."""

import subprocess
from pathlib import Path

from drivers.teensy.core import FirmwareMissingError
from drivers.transport import Transport, open_transport

PROGRAM = Path(__file__).parents[2] / "firmware" / "build" / "rig_firmware"
ENDS_S = 2.0


class FirmwareProcess:
    """A transport to a firmware process, `reference` or `grasper`, that it starts and ends.

    Raises:
        FirmwareMissingError: The program is not built.
    """

    def __init__(self, profile: str = "reference") -> None:
        if not PROGRAM.is_file():
            raise FirmwareMissingError(
                "The firmware is not built.", f"There is no {PROGRAM}.", "Run: make -C firmware"
            )
        # a group of its own: what ends the program must not end the board before it is safe
        self.process = subprocess.Popen(  # noqa: S603
            [str(PROGRAM), profile], stdout=subprocess.PIPE, text=True, process_group=0
        )
        assert self.process.stdout is not None  # noqa: S101
        self.path = self.process.stdout.readline().strip()
        self._port: Transport = open_transport(self.path)
        self.url = f"sim://pty ({self.path})"
        self.read, self.write = self._port.read, self._port.write

    @property
    def now_s(self) -> float:
        """The host's monotonic clock, seconds."""
        return self._port.now_s

    def close(self) -> None:
        """Let go of the terminal and end the process."""
        self._port.close()
        self.process.terminate()
        try:
            self.process.wait(ENDS_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()
