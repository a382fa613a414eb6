"""The drive's logic in a process of its own, in real time; asserted is its own clock and count."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from drivers.errors import LinkError
from rig.bench.logger import open_logger
from rig.bench.session import Session
from rig.configuration.config import load_config
from rig.machines.reading import Reading

pytestmark = pytest.mark.integration


def test_a_session_runs_on_it_and_nothing_is_lost_while_the_host_pauses():
    for _ in range(3):  # a busy machine may itself stop the process for longer than a tick waits
        readings = readings_of_a_host_that_pauses()
        setpoint = np.concatenate([r.setpoint for r in readings])
        assert np.array_equal(setpoint[setpoint >= 0], np.arange(800))
        tick_us = np.concatenate([r.tick_us for r in readings])
        assert (np.diff(tick_us) > 0).all()
        moved = np.concatenate([r.columns["spindle_angle_rad"] for r in readings])
        assert moved[-1] - moved[0] > 0.05
        if readings[-1].lost == 0:
            return
    pytest.fail(f"{readings[-1].lost} samples were lost in the last of three sessions")


def readings_of_a_host_that_pauses() -> list[Reading]:
    settings = load_config(Path("canopen_virtual"))
    settings = settings.changed(devices={}, safety={"watchdog_s": 1.0})
    readings = []
    with Session(settings, open_logger(settings)) as session:
        next(session.rest(0.1))
        start = session.spindle_angle_rad
        for k, reading in enumerate(session.play(start + np.linspace(0, 0.1, 800), np.zeros(800))):
            readings.append(reading)
            if k == 3:
                time.sleep(0.2)  # what is behind is read later; the ticks went on meanwhile
    return readings


def test_a_drive_that_cannot_be_reached_is_reported_with_what_to_type():
    settings = load_config(Path("canopen")).changed(
        logger={"url": "can:slcan:/dev/nonesuch?bitrate=1000000"}
    )
    with pytest.raises(LinkError, match="nonesuch"):
        open_logger(settings)


HOST = """
import numpy as np
from pathlib import Path
from rig.configuration.config import load_config
from rig.bench.logger import open_logger
from rig.bench.session import Session

config = load_config(Path("canopen_virtual")).changed(devices={}, safety={"watchdog_s": 1.0})
link = open_logger(config)
with Session(config, link) as session:
    for reading in session.play(np.full(60000, -1.04), np.zeros(60000)):
        if reading.setpoint.max() > 0:
            print(link.process.pid, flush=True)
"""


def test_a_host_that_is_killed_leaves_no_process_behind():
    with subprocess.Popen(
        [sys.executable, "-c", HOST], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as host:
        worker = int(host.stdout.readline())
        host.kill()
        host.stdout.read()
    give_up_s = time.monotonic() + 60
    with suppress(OSError):  # it is gone
        while Path(f"/proc/{worker}/stat").read_text().rpartition(")")[2].split()[0] != "Z":
            assert time.monotonic() < give_up_s, "the process is still there"
            time.sleep(0.01)


def test_ctrl_c_of_the_whole_group_lets_the_host_disarm_first():
    with subprocess.Popen(
        [sys.executable, "-c", HOST],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as host:
        host.stdout.readline()
        os.killpg(host.pid, signal.SIGINT)
        os.killpg(host.pid, signal.SIGINT)
        told = host.stderr.read()
    assert told.splitlines()[-1] == "KeyboardInterrupt"
    assert "not confirm" not in told
