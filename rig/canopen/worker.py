"""The process behind `rig.canopen.process`: ticks on the clock, whatever the recorder does.

    python -m rig.canopen.worker FD < configuration as JSON

Bytes of the logger's protocol go to and fro over the socket FD; a line of JSON on standard output
reports that it is ready, and each error.
"""

import gc
import json
import signal
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic

from drivers.epos4.driver import Epos4
from drivers.errors import DriverError
from drivers.registry import made
from drivers.transport.python_can import open_can
from rig.configuration.config import Config
from rig.logic.latch import TripLatch
from rig.logic.link import LogicLink

PERIOD_S = 0.002
"""Ticks between two polls of the host."""
LATE_S = 0.05
"""How late a SYNC may be on a real bus and still be sent."""
SAID_EVERY_S = 0.5
"""A persistent error is reported again after this time."""
LARGEST_READ = 65536


def main() -> int:
    """Run until the socket is closed or SIGTERM comes; the drive is disarmed on every way out."""
    config = Config.model_validate_json(sys.stdin.read())
    host = socket.socket(fileno=int(sys.argv[1]))
    host.setblocking(False)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the host's; it lets go when it is done
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    try:
        with _opened(config) as logger:
            logger.run(PERIOD_S)  # what is compiled the first time is compiled before anybody waits
            gc.collect()
            gc.freeze()  # a full collection of all that was imported would be a late SYNC
            _say({"ready": True})
            _serve(logger, host)
    except DriverError as error:
        _tell(error)
        return 1
    except SystemExit:
        pass
    return 0


@contextmanager
def _opened(config: Config) -> Iterator[LogicLink]:
    """Open the bus and what is on it; the drive is disarmed and the bus closed on the way out."""
    late_s = 0.0
    if config.is_simulated:
        from rig.canopen.simulated import open_live_bus

        bus = open_live_bus(config)  # its time is never late by its own clock
    else:
        bus = open_can(config.logger.url)
        late_s = LATE_S
    device = made(bus, lambda way: Epos4(way, **config.logger.options, late_s=late_s), "EPOS4")
    try:
        latch = None if config.is_simulated else TripLatch(config.logger.url)
        yield LogicLink(device, bus.url, late_s=late_s, is_cold=config.is_simulated, latch=latch)
    finally:
        device.close()


def _serve(logger: LogicLink, host: socket.socket) -> None:
    """Tick, and carry bytes to and fro, until the host has closed its end."""
    waiting = b""
    last, said_s = "", 0.0
    while True:
        try:
            data = host.recv(LARGEST_READ)
            if not data:
                return
        except BlockingIOError:
            data = b""
        except OSError:
            return
        try:
            if data:
                logger.write(data)
            logger.run(PERIOD_S)
        except DriverError as error:
            # it goes on: the host may still disarm, and what it then hears comes from the drive
            if str(error) != last or monotonic() - said_s > SAID_EVERY_S:
                last, said_s = str(error), monotonic()
                _tell(error)
        if not waiting:
            waiting = logger.take()
        waiting = waiting[_sent(host, waiting) :]


def _sent(host: socket.socket, data: bytes) -> int:
    try:
        return host.send(data) if data else 0
    except BlockingIOError:
        return 0
    except OSError:
        return len(data)  # the other end is closed; the next poll reports it


def _tell(error: DriverError) -> None:
    told = {"what": error.what, "why": error.why, "fix": error.fix}
    _say({"error": type(error).__name__, **told})


def _say(message: dict[str, object]) -> None:
    try:
        sys.stdout.write(json.dumps(message) + "\n")
        sys.stdout.flush()
    except OSError:
        pass  # the other end is closed


if __name__ == "__main__":
    sys.exit(main())
