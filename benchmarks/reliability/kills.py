"""Kill a recorder outright at random moments, repair what it left, compare with what was given."""

import random
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rig.log.check import Verdict, check_log
from rig.log.reader import read_log
from rig.log.repair import repair_log

ROOT = Path(__file__).resolve().parents[2]
RATE_HZ = 1000.0

RECORDER = """
import sys
from pathlib import Path
import numpy as np
from rig.log.run import RunInfo
from rig.log.schema import Field, Stream
from rig.log.writer import LogWriter

fields = (Field("x", "float64"), Field("sequence", "uint32"), Field("flags", "uint32"))
stream = Stream("/t", "p/msg/P", fields, 1000.0)
with LogWriter(Path(sys.argv[1]), RunInfo("killed"), [stream]) as writer:
    first = 0
    while True:
        sequence = np.arange(first, first + 7)
        rows = {"x": np.sin(sequence * 0.1), "sequence": sequence, "flags": 0 * sequence}
        writer.write("/t", rows, sequence * 1_000_000)
        first += 7
        print(first, flush=True)  # everything below this number was handed to the writer
"""


@dataclass(frozen=True)
class Killed:
    """What one killed recorder left."""

    handed_over: int
    kept: int

    @property
    def lost_s(self) -> float:
        """Time of recording lost, s."""
        return max(0, self.handed_over - self.kept) / RATE_HZ


def kill_once(folder: Path, seed: int, longest: int = 900) -> Killed:
    """Record into a folder, kill the recorder at a random moment, repair the file.

    Raises:
        AssertionError: Something other than the newest samples is lost or changed.
    """
    path = folder / "a.mcap"
    recorder = subprocess.Popen(  # noqa: S603
        [sys.executable, "-c", RECORDER, str(path)], stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    with recorder:
        assert recorder.stdout is not None
        moments = random.Random(seed).randrange(100, longest)
        lines = [recorder.stdout.readline() for _ in range(moments)]
        recorder.send_signal(signal.SIGKILL)
        lines += recorder.stdout.readlines()
    handed_over = int([line for line in lines if line.endswith("\n")][-1])
    part = folder / "a.mcap.part"
    assert [item.name for item in folder.iterdir()] == [part.name]
    assert check_log(part).verdict is Verdict.DAMAGED
    result = repair_log(part)
    assert result.repaired == folder / "a.repaired.mcap"
    log = read_log(result.repaired)
    rows = log.topics["/t"].rows
    assert log.run is not None
    assert log.run.name == "killed"
    np.testing.assert_array_equal(rows["sequence"], np.arange(len(rows)))
    np.testing.assert_array_equal(rows["x"], np.sin(np.arange(len(rows)) * 0.1))
    return Killed(handed_over, len(rows))


def kill_many(count: int) -> list[Killed]:
    """Kill recorders at so many random moments."""
    killed = []
    for seed in range(count):
        with tempfile.TemporaryDirectory() as folder:
            killed.append(kill_once(Path(folder), seed, longest=3000))
        sys.stderr.write(f"\rkilled {len(killed)} of {count}")
    sys.stderr.write("\n")
    return killed
