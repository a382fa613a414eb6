"""`rig stop` while another program has the rig: it must let go, and the board is read back."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from drivers.teensy.driver import TeensyLogger
from drivers.teensy.protocol import STATUS_ARMED
from drivers.transport import open_transport
from rig.bench.holding import holder, holding
from rig.configuration.config import load_config
from rig.errors import ExitCode

pytestmark = pytest.mark.integration

SESSION = """
import sys
import numpy as np
from pathlib import Path
from drivers.transport import open_transport
from rig.configuration.config import load_config
from rig.bench.session import Session

config = load_config(Path(sys.argv[1])).changed(safety={"watchdog_s": 1.0})
with Session(config, open_transport(config.logger.url)) as session:
    for reading in session.play(np.full(600000, -1.04), np.full(600000, 0.1)):
        if reading.setpoint.max() > 0:
            print("playing", flush=True)
"""
FOREIGN = """
import sys
from pathlib import Path
from drivers.transport import open_transport
from rig.configuration.config import load_config

link = open_transport(load_config(Path(sys.argv[1])).logger.url)
print("open", flush=True)
sys.stdin.read()
"""


def started(script: str, config: Path) -> subprocess.Popen[str]:
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    process = subprocess.Popen([sys.executable, "-c", script, str(config)], text=True, **pipes)
    assert process.stdout.readline()
    return process


def is_armed(config: Path) -> bool:
    with TeensyLogger(open_transport(load_config(config).logger.url)) as logger:
        logger.identify()
        logger.start()
        return bool(int(logger.read(1.0).samples["status"][-1]) & STATUS_ARMED)


@pytest.mark.parametrize("hangs", [False, True])
def test_a_session_that_has_the_rig_is_asked_to_end_and_killed_if_it_hangs(
    board, answered, monkeypatch, hangs
):
    with started(SESSION, board) as session:
        if hangs:
            monkeypatch.setattr("rig.bench.holding.ENDS_S", 0.2)
            os.kill(session.pid, signal.SIGSTOP)
        (told,) = answered("stop -c", board)["rigs"]
        session.communicate()
    assert told["state"] == "disarmed"
    assert told["holder"] == {"pid": session.pid, "was_killed": hangs}
    assert (session.returncode == -signal.SIGKILL) == hangs
    assert not is_armed(board)


def test_a_program_of_another_maker_is_named_and_left_alone(board, said, answered):
    with started(FOREIGN, board) as other:
        told = said("stop -c", board, code=ExitCode.SAFETY).err
        assert other.poll() is None
        other.communicate("")
    assert f"PID {other.pid}" in told
    assert "Cut the motor supply by hand." in told
    (result,) = answered("stop -c", board)["rigs"]
    assert (result["state"], result["holder"]) == ("disarmed", None)


def test_a_rig_is_held_once_under_any_of_its_names(tmp_path):
    port = tmp_path / "ttyACM0"
    port.touch()
    link = tmp_path / "by-id"
    link.symlink_to(port)
    with holding(str(port)):
        assert holder(str(link)) == os.getpid()
        with holding(str(link)):
            assert holder(str(port)) == os.getpid()
        assert holder(str(port)) == os.getpid()
    assert holder(str(port)) is None
    with holding("sim://"):
        assert holder("sim://") is None
