"""Which program holds a rig or records into a folder, and how it is asked to let go.

A program that may arm a rig holds a lock file while it does: `held-HASH.json` in the user's runtime
folder, named after the rig's URL, locked by the kernel for as long as the program lives, with its
process number inside. SIGTERM asks such a program to disarm and end (`rig.bench.interrupts`). One
that does not end in time is killed: a board and a drive then miss the host and stop by themselves.

A folder is held alike while a campaign is recorded into it: its path is then the URL. This holds
between the programs of one user on one computer.

A simulated rig is held by nobody. Where the system has no such locks nothing is held, and nobody is
found.
"""

import hashlib
import json
import os
import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, sleep

try:
    import fcntl
except ImportError:  # no such locks on this system
    fcntl = None  # type: ignore[assignment]

ENDS_S = 5.0
"""Time for a program to disarm and end: the way out takes a fraction of a second."""
LOOKS_EVERY_S = 0.02
SIMULATED = "sim:"


@dataclass(frozen=True, slots=True)
class Ending:
    """How the program that held a rig let go."""

    pid: int
    was_killed: bool  # whether it did not end when it was asked to


@contextmanager
def holding(url: str) -> Iterator[bool]:
    """Hold the rig at a URL, so that `rig stop` finds this program; yield whether it is held now.

    Another program that holds it is left alone: whether two may is the caller's affair.
    """
    path = _path(url)
    if fcntl is None or path is None:
        yield True
        return
    with path.open("a+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        file.seek(0)
        file.truncate()
        json.dump({"pid": os.getpid(), "url": url}, file)
        file.flush()
        yield True


def let_go(url: str) -> Ending | None:
    """Ask the program that holds a rig to disarm and end; None when nobody holds it.

    It is killed when it has not ended after `ENDS_S`. Returns when the rig is not held any more.

    Raises:
        PermissionError: The program is another user's.
    """
    pid = holder(url)
    if pid is None:
        return None
    os.kill(pid, signal.SIGTERM)
    if _is_released(url, ENDS_S):
        return Ending(pid, was_killed=False)
    os.kill(pid, signal.SIGKILL)
    _is_released(url, ENDS_S)
    return Ending(pid, was_killed=True)


def holder(url: str) -> int | None:
    """Return the process number of the program that holds a rig, None when nobody does."""
    path = _path(url)
    if fcntl is None or path is None or not path.exists():
        return None
    with path.open("r+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return _pid(file.read())
    return None


def _pid(text: str) -> int | None:
    try:
        return int(json.loads(text)["pid"])
    except (ValueError, KeyError, TypeError):
        return None  # it has not written it yet


def _is_released(url: str, timeout_s: float) -> bool:
    give_up_s = monotonic() + timeout_s
    while holder(url) is not None:
        if monotonic() > give_up_s:
            return False
        sleep(LOOKS_EVERY_S)
    return True


def _path(url: str) -> Path | None:
    if url.startswith(SIMULATED):
        return None
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    folder = Path(runtime or tempfile.gettempdir()) / ("rig" if runtime else f"rig-{_user()}")
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    name = hashlib.sha256(_port(url).encode()).hexdigest()[:16]
    return folder / f"held-{name}.json"


def _port(url: str) -> str:
    """Return one name for a port, however it is written."""
    from drivers.errors import LinkError
    from drivers.transport.serial_port import find_usb_port

    try:
        found = find_usb_port(url) if url.lower().startswith("usb:") else url
    except LinkError:
        found = url  # it is not plugged in
    return str(Path(found).resolve()) if found.startswith("/") else found


def _user() -> int:
    return os.getuid() if hasattr(os, "getuid") else 0
