"""A recorder killed outright loses at most a quarter second, and nothing before that changes."""

import random
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rig.log.check import Verdict, check_log
from rig.log.reader import read_log
from rig.log.repair import repair_log
from rig.log.writer import MAX_LOSS_S

ROOT = Path(__file__).resolve().parents[3]
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


@pytest.mark.parametrize("seed", range(3))
def test_a_killed_recorder_loses_at_most_a_quarter_second(tmp_path, seed):
    path = tmp_path / "a.mcap"
    recorder = subprocess.Popen(
        [sys.executable, "-c", RECORDER, str(path)], stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    with recorder:
        lines = [recorder.stdout.readline() for _ in range(random.Random(seed).randrange(100, 900))]
        recorder.send_signal(signal.SIGKILL)
        lines += recorder.stdout.readlines()
    handed_over = int([line for line in lines if line.endswith("\n")][-1])
    assert handed_over >= 700

    part = tmp_path / "a.mcap.part"
    assert [item.name for item in tmp_path.iterdir()] == [part.name]
    assert check_log(part).verdict is Verdict.DAMAGED

    result = repair_log(part)
    assert result.repaired == tmp_path / "a.repaired.mcap"
    rows = read_log(result.repaired).topics["/t"].rows
    assert len(rows) >= handed_over - MAX_LOSS_S * RATE_HZ
    np.testing.assert_array_equal(rows["sequence"], np.arange(len(rows)))
    np.testing.assert_array_equal(rows["x"], np.sin(np.arange(len(rows)) * 0.1))
    assert read_log(result.repaired).run.name == "killed"
