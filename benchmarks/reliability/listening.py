"""What listens on the network while the rig is recorded or watched, read from /proc (Linux)."""

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

CONFIGS = ("simulated", "pty", "canopen_simulated", "grasper")
TABLES = ("tcp", "tcp6", "udp", "udp6")
LISTENS = {"tcp": "0A", "udp": "07"}
"""State of a socket that takes what strangers send."""
LOOK_S = 0.05


def heard(words: list[str]) -> set[str]:
    """Return the addresses that words typed behind `rig`, and its processes, listen on meanwhile.

    Raises:
        subprocess.CalledProcessError: The command fails.
    """
    found: set[str] = set()
    with subprocess.Popen(  # noqa: S603
        [sys.executable, "-m", "rig", *words], stdout=subprocess.DEVNULL
    ) as process:
        while process.poll() is None:
            found |= listening(process.pid)
            time.sleep(LOOK_S)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, words)
    return found


def listening(process_id: int) -> set[str]:
    """Return the addresses that a process and its children listen on, as /proc writes them."""
    inodes = {inode for one in _family(process_id) for inode in _sockets(one)}
    found = set()
    for table in TABLES:
        with suppress(OSError):
            for line in Path(f"/proc/{process_id}/net/{table}").read_text().splitlines()[1:]:
                parts = line.split()
                if parts[9] in inodes and parts[3] == LISTENS[table.removesuffix("6")]:
                    found.add(parts[1])
    return found


def measure() -> dict[str, list[str]]:
    """Return the open sockets: while recording and watching every rig, and with Foxglove."""
    unasked: set[str] = set()
    with tempfile.TemporaryDirectory() as folder:
        for name in CONFIGS:
            unasked |= heard(["live", "-c", name, "--plain", "--duration", "3"])
        unasked |= heard(["record", "--sim", "-p", "unloaded", "-o", f"{folder}/campaign"])
    watched = ["live", "--sim", "--plain", "--duration", "3"]
    asked = heard([*watched, "--foxglove", "--foxglove-port", "8799"])
    return {"unasked": sorted(unasked), "asked": sorted(asked)}


def is_loopback(address: str) -> bool:
    """Whether an address of /proc is 127.0.0.1 or ::1."""
    host = address.split(":")[0]
    return host in ("0100007F", "00000000000000000000000001000000")


def _family(process_id: int) -> Iterator[int]:
    yield process_id
    with suppress(OSError):
        text = Path(f"/proc/{process_id}/task/{process_id}/children").read_text()
        for child in text.split():
            yield from _family(int(child))


def _sockets(process_id: int) -> Iterator[str]:
    """Yield the numbers of the sockets a process has open."""
    with suppress(OSError):
        for entry in Path(f"/proc/{process_id}/fd").iterdir():
            with suppress(OSError):
                target = str(entry.readlink())
                if target.startswith("socket:["):
                    yield target[8:-1]
