"""The firmware as a process on a pseudo-terminal, in real time; asserted is its own clock."""

import gc
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from drivers.errors import LinkLostError
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.protocol import STATUS_ARMED, Trip
from drivers.transport import open_transport
from rig.bench.logger import open_logger
from rig.bench.session import Session
from rig.canopen.process import CanopenProcess
from rig.configuration.config import load_config
from rig.errors import SafetyTripError
from rig.simulation.firmware_process import FirmwareProcess
from tests.rig.playing import playing

pytestmark = pytest.mark.integration


@pytest.mark.parametrize("safe_state", ["release", "hold"])
def test_a_host_that_is_killed_leaves_a_board_that_makes_itself_safe(port, board, safe_state):
    words = playing(board, safety={"watchdog_s": 0.05, "safe_state": safe_state})
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as host:
        assert host.stdout.readline().strip() == "playing"
        host.kill()
    with TeensyLogger(open_transport(port)) as logger:
        logger.identify()
        logger.start()
        while True:  # until the watchdog's patience is over
            status = int(logger.read(1.0).samples["status"][-1])
            if not status & STATUS_ARMED:
                break
        report = logger.trip()
    assert report.code is Trip.HOST_SILENT
    assert 50_000 < report.late_us <= 52_000


def test_a_second_program_on_the_port_is_refused_and_the_first_goes_on(port, board, tmp_path):
    rig = [sys.executable, "-m", "rig"]
    first = [*rig, "live", "-c", str(board), "--json"]
    with subprocess.Popen(first, stdout=subprocess.PIPE, text=True) as live:
        live.stdout.readline()
        second = [*rig, "record", "-c", str(board), "-p", "quick", "-o", str(tmp_path / "a")]
        refused = subprocess.run(second, capture_output=True, text=True, check=False)
        later = [json.loads(live.stdout.readline()) for _ in range(5)]
        live.send_signal(signal.SIGINT)
    assert refused.returncode == 3
    assert f"{port} is in use" in refused.stderr
    assert f"PID {live.pid}" in refused.stderr
    assert [one["lost"] for one in later] == [0] * 5


@pytest.mark.parametrize(
    ("name", "kind"), [("pty", FirmwareProcess), ("canopen_virtual", CanopenProcess)]
)
def test_a_process_that_dies_is_a_lost_link(program, name, kind):
    config = load_config(Path(name)).changed(devices={}, safety={"watchdog_s": 1.0})
    link = open_logger(config)
    assert isinstance(link, kind)
    unsafe = pytest.raises(SafetyTripError, match="did not confirm")
    with unsafe as left, Session(config, link) as session:
        next(session.rest(0.1))
        link.process.kill()
        with pytest.raises(LinkLostError):
            for _ in session.watch():
                pass
    assert "Cut the motor supply" in left.value.fix
    assert link.process.poll() is not None


WATCHER = """
from pathlib import Path
from rig.configuration.config import load_config
from rig.bench.logger import open_logger
from rig.bench.session import Session

config = load_config(Path("pty"))
try:
    with Session(config, open_logger(config)) as session:
        for _ in session.watch():
            print("watching", flush=True)
except BaseException as error:
    print(repr(error), flush=True)
"""


def test_a_signal_to_the_whole_group_ends_the_program_after_the_board_is_safe(program):
    with subprocess.Popen(
        [sys.executable, "-c", WATCHER], stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as host:
        assert host.stdout.readline().strip() == "watching"
        os.killpg(host.pid, signal.SIGTERM)
        told = host.stdout.read().splitlines()[-1]
    assert "not confirm" not in told
    assert "SafetyTripError" not in told
    assert told.startswith(("KeyboardInterrupt", "SystemExit", "Terminated")), told


def test_a_motion_in_real_time_is_not_held_up_by_a_collection_of_all_objects(library):
    config = load_config(Path("pty"))
    before = gc.get_freeze_count()
    with Session(config, open_logger(config)) as session:
        next(session.rest(0.1))
        still = np.full(50, session.here[0])
        for _ in session.play(still, np.zeros(50)):
            looked_at = len(gc.get_objects())
    assert looked_at < len(gc.get_objects()) / 10
    assert gc.get_freeze_count() == before
