"""The master's driver on its fake, and a grasper whose three motors follow it in position."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from drivers.errors import LinkTimeoutError
from drivers.teensy.grasper import GRASPER
from drivers.teensy_master.fake import REACH, open_fake
from drivers.transport.faulty import Faults
from rig.bench.firmware import source_hash
from rig.bench.logger import open_logger
from rig.configuration.config import SHIPPED, load_config
from rig.errors import ExitCode, UsageError
from rig.grasper import follow
from rig.grasper.coupling import GrasperError
from rig.grasper.follow import setpoints
from rig.grasper.machine import axes_of_joints
from rig.grasper.settings import master_section
from rig.log.reader import read_log
from tests.rig.simulated import is_armed

pytestmark = pytest.mark.integration

GRASPER_CONFIG = load_config(Path("grasper"))
CHIEF = master_section(GRASPER_CONFIG)
HERE = (0.1, 0.0, -0.05)


@pytest.fixture
def potentiometers():
    device = open_fake(Faults())
    device.start()
    yield device
    device.close()


@pytest.fixture
def link(monkeypatch, library):
    """The simulated grasper's link, to look at its board afterwards."""
    link = open_logger(GRASPER_CONFIG)
    monkeypatch.setattr(follow, "open_logger", lambda config: link)
    return link


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Logs go to the folder of the test."""
    monkeypatch.chdir(tmp_path)


def remembered(device):
    """Return a list that fills with the counts that the device's reads return."""
    counts, read = [], device.read

    def reading(timeout_s):
        batch = read(timeout_s)
        counts.append(np.column_stack(list(batch.columns.values())))
        return batch

    device.read = reading
    return counts


def test_setpoints_are_the_masters_own_turn_from_where_the_grasper_stands(potentiometers):
    counts = remembered(potentiometers)
    asked = list(setpoints(potentiometers, CHIEF, HERE, 1.0, scale=0.5))
    axes = np.concatenate([np.column_stack(piece) for piece in asked])
    joints = CHIEF.joint_rad(np.concatenate(counts)[:2000])
    assert len(axes) == 2000
    np.testing.assert_allclose(axes[0], HERE)
    np.testing.assert_allclose(axes, HERE + axes_of_joints(0.5 * (joints - joints[0])), atol=1e-12)


def test_three_motors_go_where_the_master_goes(link, answered):
    told = answered("grasper follow --sim --duration 3 --scale 0.3")
    assert not is_armed(link.board, GRASPER)
    reach_rad = 0.3 * REACH * np.radians(300.0) / 4095
    yaw, jaw_1, jaw_2 = told["axes"]
    assert yaw["highest_rad"] == pytest.approx(reach_rad, rel=0.1)
    assert yaw["lowest_rad"] == pytest.approx(-reach_rad, rel=0.1)
    for axis in (yaw, jaw_1, jaw_2):
        assert axis["largest_error_rad"] < 0.1 * reach_rad
    assert max(jaw_1["largest_force_n"], jaw_2["largest_force_n"]) > 0.5  # the jaws meet
    log = read_log(Path(told["log"]))
    assert log.end.clean
    assert log.run.conditions == {"trajectory": "follow"}
    assert int(log.run.details["firmware_build"], 16) == source_hash()
    assert len(log.topics["/rig/sample"]) >= 6000


def test_the_firmware_process_follows_in_real_time(library, answered):
    told = answered("grasper follow -c grasper_pty --duration 1")
    assert all(axis["highest_rad"] > axis["lowest_rad"] for axis in told["axes"])
    assert read_log(Path(told["log"])).end.clean


def test_a_master_that_requests_too_much_trips_the_grasper(link, said):
    words = "grasper follow --sim --duration 6 --scale 1"
    assert "force" in said(words, code=ExitCode.SAFETY).err
    assert not is_armed(link.board, GRASPER)


def test_a_broken_wire_disarms_the_motors(link, monkeypatch, tmp_path):
    device = open_fake(Faults())
    read, reads, followed = device.read, [], []

    def broken(timeout_s):
        batch = read(timeout_s)
        reads.append(batch)
        if len(reads) > 20:
            batch.columns["pitch_count"][:] = 0
        return batch

    device.read = broken
    monkeypatch.setattr(follow, "open_section", lambda section: device)
    with pytest.raises(GrasperError, match="rail"):
        follow.follow_master(GRASPER_CONFIG, None, 5.0, 0.2, tmp_path, followed.append)
    assert followed[-1] > 0.1
    assert not is_armed(link.board, GRASPER)


def test_ctrl_c_quits_with_disarmed_motors(link, monkeypatch, said):
    pieces = []

    def asked(*given):
        for piece in setpoints(*given):
            pieces.append(piece)
            if len(pieces) == 20:
                os.kill(os.getpid(), signal.SIGINT)
            yield piece

    monkeypatch.setattr(follow, "setpoints", asked)
    assert "safe" in said("grasper follow --sim", code=ExitCode.INTERRUPTED).err
    assert len(pieces) == 20
    assert not is_armed(link.board, GRASPER)


@pytest.mark.parametrize(
    ("config", "url", "said"),
    [
        ("simulated", None, "is not a grasper"),
        ("bench", None, "Where is the master"),
        ("bench", "sim://", "simulated master"),
    ],
)
def test_what_cannot_be_followed_is_refused(config, url, said, library, tmp_path):
    bench = GRASPER_CONFIG.changed(logger={"url": "usb:16c0:0483"})
    chosen = bench if config == "bench" else load_config(Path(config))
    with pytest.raises(UsageError, match=said):
        follow.follow_master(chosen, url, 1.0, 0.2, tmp_path)


def test_a_silent_master_is_reported(potentiometers):
    potentiometers.stop()
    with pytest.raises(LinkTimeoutError, match="sent nothing"):
        next(setpoints(potentiometers, CHIEF, HERE, 1.0))


def test_zero_and_turn_of_each_potentiometer_are_the_configurations():
    by_default = np.degrees(CHIEF.joint_rad([4094, 2048, 1]))
    np.testing.assert_allclose(by_default, [149.89, 0.0, -149.96], atol=0.01)  # of 300 degrees
    own = {"zero_counts": (2000, 2048, 2100), "rad_per_count": (1e-3, -1e-3, 2e-3)}
    chief = master_section(GRASPER_CONFIG.changed(machine={"master": own}))
    np.testing.assert_allclose(chief.joint_rad([2100, 2148, 2000]), [0.1, -0.1, -0.2])


@pytest.mark.parametrize("counts", [[0, 2048, 2048], [2048, 4095, 2048], [2048, 2048, np.nan]])
def test_a_potentiometer_at_its_rail_commands_nothing(counts):
    with pytest.raises(GrasperError, match="rail"):
        CHIEF.joint_rad(counts)


@pytest.mark.parametrize("turn", ["0", "nan", "1.0"])
def test_a_potentiometer_that_shows_nothing_is_refused(turn, tmp_path):
    path = tmp_path / "rig.toml"
    shipped = (SHIPPED / "grasper.toml").read_text()
    path.write_text(f"{shipped}\n[machine.master]\nrad_per_count = [1e-3, {turn}, 1e-3]\n")
    with pytest.raises(UsageError, match="rad_per_count"):
        load_config(path)
