"""The logger's logic on a CANopen drive in real time, in a separate process without delays.

The program that records talks to it as to a board on USB: the logger's bytes, over a pair of
sockets without a name. It reports errors on its standard output, one line of JSON each, and
they are raised here. It ends, the drive disarmed, when this end is closed or its program is gone.
"""

import json
import os
import select
import socket
import subprocess
import sys

from drivers import errors
from drivers.epos4.faults import DriveFaultError
from drivers.errors import DriverError, LinkLostError, LinkTimeoutError
from drivers.transport.transport import HostLink
from rig.configuration.config import Config

STARTS_S = 90.0
"""Time for the drive to be set up; the code is compiled the first time."""
ENDS_S = 3.0
TAKES_S = 1.0
"""Time for the process to read sent data; it polls every 2 ms."""
LARGEST_READ = 65536
_KINDS: dict[str, type[DriverError]] = {
    name: kind
    for name, kind in vars(errors).items()
    if isinstance(kind, type) and issubclass(kind, DriverError)
} | {"DriveFaultError": DriveFaultError}


class CanopenProcess(HostLink):
    """A transport to such a process of a rig with an EPOS4, which it starts and ends.

    Raises:
        DriverError: The drive cannot be reached or set up.
    """

    def __init__(self, config: Config) -> None:
        super().__init__(config.logger.url)
        ours, theirs = socket.socketpair()
        with theirs:
            # a group of its own: what ends this program must not end that before the drive is safe
            self.process = subprocess.Popen(  # noqa: S603
                [sys.executable, "-m", "rig.canopen.worker", str(theirs.fileno())],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                pass_fds=(theirs.fileno(),),
                process_group=0,
            )
        self._socket = ours
        self._socket.setblocking(False)
        assert self.process.stdin is not None  # noqa: S101
        assert self.process.stdout is not None  # noqa: S101
        self._told = self.process.stdout.fileno()
        self._text = b""
        with self.process.stdin as there:
            there.write(config.model_dump_json().encode())
        try:
            self._wait_until_ready()
        except BaseException:
            self.close()
            raise

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that are there, waiting at most `timeout_s` for the first.

        Raises:
            DriverError: The drive has a fault, is silent, or its bus is gone.
            LinkLostError: The process is gone.
        """
        self._require_link()
        link = self._socket.fileno()
        ready, _, _ = select.select([link, self._told], [], [], max(0.0, timeout_s))
        if self._told in ready:
            self._hear()
        if link not in ready:
            return b""
        data = self._socket.recv(LARGEST_READ)
        if not data:
            raise self._gone()
        return data

    def write(self, data: bytes) -> None:
        """Send all of `data`; LinkLostError where the process is gone."""
        self._require_link()
        try:
            self._socket.settimeout(TAKES_S)
            self._socket.sendall(data)
        except OSError as error:
            raise self._gone() from error
        finally:
            self._socket.setblocking(False)

    def close(self) -> None:
        """Let go: the process disarms the drive, where it may be energised, and ends.

        Raises:
            DriverError: The drive has not confirmed that it is disarmed.
        """
        if not self._closes():
            return
        self._socket.close()
        try:
            self.process.wait(ENDS_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        assert self.process.stdout is not None  # noqa: S101
        with self.process.stdout:
            last = self._text + self.process.stdout.read()
        for line in last.splitlines():
            _raise_if_error(line)

    def _wait_until_ready(self) -> None:
        give_up_s = self.now_s + STARTS_S
        while True:
            left_s = give_up_s - self.now_s
            if not select.select([self._told], [], [], max(0.0, left_s))[0]:
                raise LinkTimeoutError(
                    f"The drive at {self.url} was not set up in {STARTS_S:g} s.",
                    fix="Run: rig doctor",
                )
            if self._hear():
                return

    def _hear(self) -> bool:
        """Read the messages of the process, raise what it reports; return whether it is ready."""
        said = os.read(self._told, LARGEST_READ)
        if not said:
            raise self._gone()
        *lines, self._text = (self._text + said).split(b"\n")
        for line in lines:
            _raise_if_error(line)
        return bool(lines)

    def _gone(self) -> LinkLostError:
        return LinkLostError(
            f"The process that drives the EPOS4 at {self.url} is gone.",
            f"It ended with {self.process.poll()}.",
            "Take the motor for live and cut its supply. A working drive stops by itself when it"
            " misses the heartbeat.",
        )


def _raise_if_error(line: bytes) -> None:
    try:
        told = json.loads(line)
    except ValueError:
        return  # it was ended in the middle of a line
    if "error" in told:
        kind = _KINDS.get(told["error"], DriverError)
        raise kind(told["what"], told["why"], told["fix"])
