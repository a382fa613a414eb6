"""How fast a log is read as arrays, against the `mcap` package's ordered iteration of it."""

import tempfile
from collections import deque
from pathlib import Path

import numpy as np
from mcap.reader import make_reader

from benchmarks.ratio import Ratio, best_of
from rig.log.reader import read_log
from rig.log.run import RunInfo
from rig.log.schema import Field, Stream
from rig.log.writer import LogWriter

MESSAGES = 300_000
COLUMNS = 16
"""Channels of float64; a sequence number and flags follow them."""


def write(path: Path) -> None:
    """Write a log as a recorder does: 20 ms of 12-bit samples at a time, flushed on the timer."""
    names = [f"channel_{index}_v" for index in range(COLUMNS)]
    fields = [Field(name, "float64", "V") for name in names]
    integers = (Field("sequence", "uint32"), Field("flags", "uint32"))
    stream = Stream("/rig/sample", "rig_msgs/msg/Sample", (*fields, *integers), 1000.0)
    random = np.random.default_rng(0)
    phases = random.uniform(0, 2 * np.pi, COLUMNS)
    with LogWriter(path, RunInfo("benchmark"), [stream]) as writer:
        for first in range(0, MESSAGES, 20):
            sequence = np.arange(first, first + 20)
            rows = np.zeros(20, stream.dtype)
            for name, phase in zip(names, phases, strict=True):
                volts = np.sin(2 * np.pi * sequence * 1e-3 + phase) + random.normal(0, 5e-3, 20)
                rows[name] = np.round(volts * 2048) / 2048
            rows["sequence"] = sequence
            writer.write("/rig/sample", rows, sequence * 1_000_000)


def measure() -> list[Ratio]:
    """Write one log and read it both ways."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "benchmark.mcap"
        write(path)
        megabytes = path.stat().st_size / 1e6

        def iterate() -> None:
            with path.open("rb") as file:
                deque(make_reader(file).iter_messages(), maxlen=0)

        arrays_s = best_of(lambda: read_log(path), 15)
        messages_s = best_of(iterate, 3)
    return [
        Ratio(
            "reading a log as arrays over ordered iteration with mcap",
            messages_s / arrays_s,
            25.0,
            detail=f"{MESSAGES / arrays_s / 1e6:.2f} M messages/s over "
            f"{MESSAGES / messages_s / 1e6:.3f} M/s, {megabytes:.0f} MB, checksums checked",
        )
    ]
