"""How long `rig campaigns` takes to list 10,000 runs, against a bare interpreter's start."""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from benchmarks.ratio import Ratio
from rig.log.run import RunEnd, RunInfo
from rig.log.schema import Field, Stream
from rig.log.writer import LogWriter

FOLDERS, RUNS = 500, 20


def measure() -> list[Ratio]:
    """Index the runs once, then time the command as a whole process."""
    with tempfile.TemporaryDirectory() as place:
        root = Path(place) / "logs"
        _fill(root)
        environment = {**os.environ, "XDG_CACHE_HOME": str(Path(place) / "cache")}
        words = ["-m", "rig", "campaigns", "frequency_hz>=0.5", "--root", str(root)]

        def run(*more: str) -> None:
            subprocess.run(  # noqa: S603
                [sys.executable, *more], check=True, capture_output=True, env=environment
            )

        run(*words)
        listed_s = min(_processor_s(lambda: run(*words)) for _ in range(3))
        bare_s = min(_processor_s(lambda: run("-c", "pass")) for _ in range(3))
    return [
        Ratio(
            f"`rig campaigns` on {FOLDERS * RUNS:,} indexed runs, processor s",
            listed_s,
            1.0,
            higher_is_better=False,
            detail=f"{listed_s * 1e3:.0f} ms; a bare interpreter takes {bare_s * 1e3:.0f} ms",
        )
    ]


def _processor_s(action: Callable[[], None]) -> float:
    """Return the processor time of the processes that an action starts, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    action()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _fill(root: Path) -> None:
    """Write one folder of logs and copy it."""
    stream = Stream(
        "/rig/sample", "rig_msgs/msg/Sample", (Field("time_s", "float64", "s"),), 1000.0
    )
    first = root / "000"
    first.mkdir(parents=True)
    for k in range(RUNS):
        info = RunInfo(f"{k:03d}", "bench", conditions={"frequency_hz": 0.1 * k, "load_a": 0.3})
        with LogWriter(first / f"{k:03d}.mcap", info, [stream]) as log:
            log.close(RunEnd())
    for k in range(1, FOLDERS):
        shutil.copytree(first, root / f"{k:03d}")
