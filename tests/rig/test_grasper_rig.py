"""The 3-DOF grasper: the session, the recorder and the live display run on its board unchanged."""

import json
from pathlib import Path

import numpy as np
import pytest

from drivers.teensy.core import FirmwareBoard
from drivers.teensy.protocol import Trip
from drivers.transport.simulated import SimulatedTransport
from rig.bench.logger import open_logger
from rig.bench.session import Session
from rig.configuration.config import Config, load_config
from rig.errors import SafetyTripError, UsageError
from rig.grasper.machine import axes_of_joints
from rig.log.check import check_log
from rig.log.reader import read_log
from rig.protocols.protocol import Protocol, load_protocol, protocol_toml
from rig.recording.campaign import open_campaign_folder, record_campaign

pytestmark = pytest.mark.integration

STILL = np.zeros(2000)


def grasper(**changes: object) -> Config:
    return load_config(Path("grasper")).changed(**changes)


def table(joint: str, angle_rad: float) -> dict[str, object]:
    angles = {"joints": [joint], "angles_rad": [angle_rad]}
    return {"kind": "joint_hold", **angles, "hold_s": 0.3, "rise_s": 0.3}


@pytest.fixture(params=["python", "firmware"])
def config(request: pytest.FixtureRequest, library: Path) -> Config:
    return grasper(simulation={"firmware": request.param == "firmware"})


def test_joints_become_motors_of_which_the_jaws_close_on_one_another():
    joints = np.array([[0.1, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.4], [0.0, 0.1, 0.4]])
    expected = [[0.1, 0, 0], [0, 0.2, -0.2], [0, 0.2, 0.2], [0, 0.3, 0.1]]
    np.testing.assert_allclose(axes_of_joints(joints), expected, atol=1e-12)


def test_a_campaign_at_2_khz_closes_the_jaws_and_measures_their_force(config, tmp_path):
    protocol = Protocol.model_validate(
        {"name": "short", "runs": [table("yaw", 0.05), table("grasp", 0.28)]}
    )
    todo = open_campaign_folder(tmp_path / "runs", protocol, config, resume=False)
    link = open_logger(config)
    assert isinstance(link.board, FirmwareBoard) == config.simulation.firmware
    with Session(config, link) as session:
        free, closed = record_campaign(session, todo, tmp_path / "runs")
    for result in (free, closed):
        assert result.complete
        assert check_log(result.path).verdict.exit_code == 0
    log = read_log(closed.path)
    rows = log.topics["/rig/sample"].rows
    np.testing.assert_allclose(np.diff(rows["time_s"]), 5e-4, rtol=1e-6)
    assert set(log.topics["/rig/counts"].rows.dtype.names) >= {"motor_3", "force_1", "command_2_e4"}
    for jaw in ("jaw_1", "jaw_2"):
        assert np.abs(rows[f"{jaw}_angle_rad"] - rows[f"{jaw}_target_rad"]).max() < 0.02
        assert 1.0 < rows[f"{jaw}_force_n"].max() < 1.4
    assert rows["yaw_force_n"].max() < 0.1
    yaw = read_log(free.path).topics["/rig/sample"].rows["yaw_angle_rad"]
    assert yaw.max() == pytest.approx(0.05, abs=0.005)


@pytest.mark.parametrize(
    ("change", "motion", "trip"),
    [
        ({"limits": {"jaw_2_force_n": 0.4}}, (0, 0, 0.14), Trip.OVER_FORCE),
        ({"limits": {"yaw_current_a": 0.01}}, (0.14, 0, 0), Trip.OVER_CURRENT),
        ({"safety": {"motor_speed_rad_s": 14.0}}, (0, 0.13, 0), Trip.OVER_SPEED),
        ({"safety": {"stall_current_a": 0.015, "stall_s": 0.3}}, (0, 0, 0.2), Trip.STALLED),
        ({"safety": {"continuous_current_a": 0.004, "heat_a2_s": 1e-5}}, (0.12, 0, 0), 8),
    ],
)
def test_a_trip_of_any_motor_takes_all_three_out_of_force(library, change, motion, trip):
    settings = grasper(simulation={"firmware": True}, **change)
    link = open_logger(settings)
    ramp = np.minimum(np.arange(3000) / 1000, 1.0)
    tripped = pytest.raises(SafetyTripError, match=f"code {int(trip)}")
    with tripped as told, Session(settings, link) as session:
        session.take_zeros(0.1)
        for _ in session.play(*(target * ramp for target in motion)):
            pass
    axis = ("yaw", "jaw_1", "jaw_2")[int(np.argmax(np.abs(motion)))]
    number = 1 + int(np.argmax(np.abs(motion)))
    assert axis in told.value.what or f"_{number}" in told.value.what
    with Session(settings, SimulatedTransport(link.board, tick_s=5e-4)) as session:
        (*_, last) = session.rest(0.05)
    assert all((last.counts[f"command_{k}_e4"] == 0).all() for k in (1, 2, 3))
    assert not last.armed


@pytest.mark.parametrize("bad", [1.01, -1.01, np.nan, np.inf])
def test_no_target_beyond_a_motors_travel_or_no_number_is_sent(config, bad):
    with Session(config, open_logger(config)) as session:
        targets = STILL.copy()
        targets[-1] = bad
        with pytest.raises(SafetyTripError, match="jaw_2_angle_rad"):
            next(session.play(STILL, STILL, targets))


def test_protocols_and_rigs_of_different_kinds_refuse_each_other(tmp_path):
    with pytest.raises(UsageError, match="grasper"):
        load_protocol("grasper").plans()
    with pytest.raises(UsageError, match=r"spindle.*Choose a protocol"):
        mixed(grasper(), "quick", tmp_path / "a")
    with pytest.raises(UsageError, match=r"joints of a grasper"):
        mixed(load_config(), "grasper", tmp_path / "b")
    with Session(grasper(), open_logger(grasper())) as session:  # noqa: SIM117
        with pytest.raises(UsageError, match=r"yaw_target_rad.*another kind of rig"):
            next(session.play(STILL, STILL))
    two = [table("yaw", 0.1), {"kind": "sine", "frequencies_hz": [1.0], "loads_a": [0.0]}]
    with pytest.raises(ValueError, match="no rig has both"):
        Protocol.model_validate({"name": "both", "runs": two})


def mixed(config: Config, protocol: str, folder: Path) -> None:
    todo = open_campaign_folder(folder, load_protocol(protocol), config, resume=False)
    with Session(config, open_logger(config)) as session:
        list(record_campaign(session, todo[:1], folder))


def test_commands_on_the_grasper_as_a_person_types_them(tmp_path, said, answered):
    path, out = tmp_path / "short.toml", tmp_path / "campaign"
    run = {"kind": "joint_sine", "joints": ["grasp"], "angles_rad": [0.25], "duration_s": 0.5}
    protocol = {"name": "short", "runs": [run | {"frequencies_hz": [2.0]}]}
    path.write_text(protocol_toml(Protocol.model_validate(protocol)))
    assert answered("record -c grasper -p", path, "-o", out)["look_at"] == []
    said("log check", out)
    printed = said("live -c grasper --pace 0 --json -p", path).out
    assert json.loads(printed.splitlines()[-1])["summary"]["lost"] == 0
    for command in ("doctor", "selftest", "stop", "config show"):
        said(command, "grasper" if command == "config show" else "-c grasper")
    assert "grasper protocol" in said("firmware version -c grasper").out
    for command in ("grip --torque 0.05", "calibrate torque --operator me --yes"):
        assert "is a grasper" in said(command, "-c grasper", code=2).err
