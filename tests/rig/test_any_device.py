"""Any registered driver where a rig has its logger: recorded, shown, calibrated, and left safe."""

import json
import os
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from drivers.dynamixel.driver import Dynamixel
from drivers.dynamixel.fake import DynamixelFake
from drivers.epos4.protocol import State
from drivers.errors import DisarmUnconfirmedError, DriverError
from drivers.moteus.driver import Moteus
from drivers.moteus.fake import MoteusFake
from drivers.registry import fakes
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.protocol import Trip
from drivers.transport.faulty import Faults
from drivers.transport.simulated import SimulatedTransport
from rig.bench.logger import open_logger
from rig.bench.session import Session
from rig.canopen.simulated import open_simulated_canopen
from rig.configuration.config import Config, load_config
from rig.errors import SafetyTripError, UsageError
from rig.log.reader import read_log
from rig.log.streams import SAMPLE
from rig.logic.latch import TripLatch
from rig.logic.link import LogicLink

pytestmark = pytest.mark.integration

COUNTED = {"teensy": "spindle_count", "teensy-master": "yaw_count"}
"""Drivers whose channels need a calibration, and one of these channels."""
DRIVES = {"dynamixel": (DynamixelFake, Dynamixel), "moteus": (MoteusFake, Moteus)}
EPOS4 = "epos4"
EVERY_DRIVE = pytest.mark.parametrize("name", [*sorted(DRIVES), EPOS4])


class Rig:
    """A simulated rig whose drive's fake can be reached."""

    most_behind_rad = 0.1

    def __init__(self, name: str, **changes: object) -> None:
        make_fake, make_device = DRIVES[name]
        self.fake = make_fake()
        self.device = make_device(SimulatedTransport(self.fake))
        self.config: Config = load_config(Path(f"{name}_simulated")).changed(**changes)

    @property
    def in_force(self) -> bool:
        if isinstance(self.fake, DynamixelFake):
            return self.fake.in_force
        return bool(self.fake.mode)  # 0 is stopped

    def session(self) -> Session:
        return Session(self.config, open_logger(self.config))


class CanopenRig(Rig):
    """The rig of an EPOS4, whose motor is the simulated plant."""

    most_behind_rad = 0.03

    def __init__(self, **changes: object) -> None:
        self.config = load_config(Path("canopen_simulated")).changed(devices={}, **changes)
        self.link = open_simulated_canopen(self.config)
        (self.fake,) = self.link._device._bus._nodes

    @property
    def in_force(self) -> bool:
        return self.fake.state is not State.SWITCH_ON_DISABLED

    def session(self) -> Session:
        return Session(self.config, self.link)


@pytest.fixture
def rig_of(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Rig]:
    def make(name: str, **changes: object) -> Rig:
        if name == EPOS4:
            return CanopenRig(**changes)
        rig = Rig(name, **changes)
        monkeypatch.setattr("rig.bench.logger.open_fake", lambda _: rig.device)
        return rig

    return make


def moving(session: Session, seconds: float = 2.0, travel_rad: float = 0.4):
    ticks = round(seconds * session.machine.profile.rate_hz)
    return session.play(session.here[0] + np.linspace(0, travel_rad, ticks), np.zeros(ticks))


@pytest.mark.parametrize("name", sorted(fakes()))
def test_every_driver_is_recorded_and_shown(name, tmp_path, said, answered):
    lines = ""
    if name in COUNTED:
        lines = f'[channels.shaft_rad]\ncounts = "{COUNTED[name]}"\nslope = 1e-3\n'
    (tmp_path / "lines.toml").write_text(f'name = "own"\n[channels]\n{lines}')
    (tmp_path / "rig.toml").write_text(
        f'name = "{name}"\ncalibration = "{tmp_path / "lines.toml"}"\n'
        f'[logger]\ndriver = "{name}"\nprofile = "sensor"\nurl = "sim://"\n'
    )
    (tmp_path / "short.toml").write_text(
        'name = "short"\n[[runs]]\nkind = "rest"\nduration_s = 1.0\n'
    )
    rig, protocol = ("-c", tmp_path / "rig.toml"), ("-p", tmp_path / "short.toml")
    (run,) = answered("record", *rig, *protocol, "-o", tmp_path / "runs")["runs"]
    assert run["samples"] == run["expected"]
    log = read_log(Path(run["path"]))
    columns = log.topics[SAMPLE].rows
    device = fakes()[name](Faults())
    device.start()
    channels = [channel for channel in device.channels if channel.unit != "count"]
    device.close()
    named = [n for n in columns.dtype.names if n not in ("time_s", "sequence", "flags")]
    assert len(named) == (1 if name in COUNTED else len(channels))
    assert (columns["flags"] == 0).all()
    time_s = columns["time_s"]
    assert time_s[-1] - time_s[0] == pytest.approx(1.0, abs=1.5 * np.diff(time_s).max())
    printed = said("live --duration 0.3 --pace 0 --json", *rig).out
    first, *_, last = (json.loads(line) for line in printed.splitlines())
    assert last["summary"]["lost"] == 0
    assert set(first["channels"]) <= set(named)


@EVERY_DRIVE
def test_a_drive_follows_its_target_and_gives_all_that_it_measures(rig_of, name):
    rig = rig_of(name)
    with rig.session() as session:
        next(session.rest(0.1))
        readings = list(moving(session))
        assert rig.in_force
    columns = readings[-1].columns
    behind_rad = columns["target_angle_rad"][-1] - columns["spindle_angle_rad"][-1]
    assert abs(behind_rad) < rig.most_behind_rad
    played = np.concatenate([reading.setpoint for reading in readings])
    assert np.array_equal(played[played >= 0], np.arange(2 * session.machine.profile.rate_hz))
    if name in DRIVES:
        assert 273 < columns["temperature_k"][-1] < 343
        assert columns["supply_v"][-1] > 0
    assert not rig.in_force


def raised(error: BaseException) -> None:
    raise error


WAYS_OUT = {
    "a mistake in the program": (lambda: raised(RuntimeError()), RuntimeError),
    "ctrl-c": (lambda: raised(KeyboardInterrupt()), KeyboardInterrupt),
    "sigterm": (lambda: os.kill(os.getpid(), signal.SIGTERM), (KeyboardInterrupt, SystemExit)),
    "enough seen": (lambda: raised(StopIteration()), StopIteration),
}


@EVERY_DRIVE
@pytest.mark.parametrize("way_out", WAYS_OUT)
def test_no_way_out_leaves_a_motor_in_force(rig_of, name, way_out):
    rig = rig_of(name)
    leave, error = WAYS_OUT[way_out]
    with pytest.raises(error), rig.session() as session:  # noqa: PT012
        next(session.rest(0.1))
        readings = moving(session)
        next(readings)
        assert rig.in_force
        leave()
        list(readings)
    assert not rig.in_force


CROSSED = (
    ({"limits": {"motor_current_a": 0.002}}, "current"),
    ({"limits": {"temperature_k": 290.0}}, "temperature_k reached"),
    ({"safety": {"motor_speed_rad_s": 0.05}}, "too fast"),
    ({"plausibility": {"following_rad": 0.01, "following_s": 0.02}}, "behind its target"),
)
CROSSED_ON_CAN = (
    ({"limits": {"motor_current_a": 0.05}}, "current"),
    ({"safety": {"motor_speed_rad_s": 2.0}}, "too fast"),
    ({"safety": {"watchdog_s": 0.005}}, "received nothing"),
)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        *((name, *row) for name in sorted(DRIVES) for row in CROSSED),
        *((EPOS4, *row) for row in CROSSED_ON_CAN),
    ],
)
def test_the_limits_hold_on_a_drive(rig_of, name, change, message):
    rig = rig_of(name, **change)
    unsafe = pytest.raises((SafetyTripError, DriverError), match=message)
    with unsafe, rig.session() as session:
        next(session.rest(0.1))
        list(moving(session, 1.0, 2.0))
    assert not rig.in_force


@EVERY_DRIVE
def test_a_drive_that_falls_silent_is_reported_as_unknown(rig_of, name, monkeypatch):
    rig = rig_of(name)
    unsafe = pytest.raises((SafetyTripError, DisarmUnconfirmedError), match="not confirm")
    with unsafe, rig.session() as session:
        next(session.rest(0.1))
        for _ in moving(session):
            monkeypatch.setattr(rig.fake, "transmit", lambda: b"")
    rig.fake.advance(1000)  # nobody asks any more: its own watch ends it
    current = rig.fake.current if isinstance(rig.fake, DynamixelFake) else rig.fake.torque_n_m
    assert current == 0


def test_the_current_of_a_drive_is_calibrated_without_a_torque_sensor(tmp_path, answered):
    words = ("-c dynamixel_simulated --yes --operator a -o", tmp_path / "raw")
    said = answered("calibrate current", *words, "--store", tmp_path / "s")
    (record,) = said["records"].values()
    assert record["fit"]["parameters"]["gain_a"] == pytest.approx(1.75, rel=0.02)
    # the fake's speed rings, so that the current of its inertia does not quite cancel;
    # its rotor: 4 units of speed lost for 40 gained a milliampere, 0.229 rpm a unit
    damping = 4 / 40 * 1e-3 / (0.229 * 2 * np.pi / 60)
    assert said["found"]["damping_current_at_1_rad_s_a"] == pytest.approx(damping, rel=0.06)
    assert abs(said["found"]["friction_current_a"]) < 1e-3


def test_what_needs_a_motor_is_refused_in_words(tmp_path, said):
    text = 'name = "cell"\ncalibration = "sensor"\n[logger]\nurl = "sim://"\n'
    text += 'driver = "{}"\nprofile = "{}"\n'
    path = tmp_path / "rig.toml"
    path.write_text(text.format("amt21", "sensor"))
    for command in ("selftest", "clear"):
        assert "no motors to arm, stop or test" in said(command, "-c", path, code=2).err
    gains = "[controller]\nkp = 1\nki = 0\nkd = 0\nvelocity_filter = 1\n"
    limits = "[limits]\nmotor_current_a = 1\nspindle_angle_rad = 1\n"
    path.write_text(text.format("amt21", "drive") + gains + limits)
    with pytest.raises(UsageError, match="has no motor"):
        open_logger(load_config(path))
    path.write_text(text.format("dynamixel", "drive") + limits)
    with pytest.raises(UsageError, match="controller"):
        load_config(path)


@pytest.mark.parametrize("name", sorted(DRIVES))
def test_a_trip_stays_over_processes_until_it_is_cleared_by_its_name(name, tmp_path):
    rig = Rig(name, safety={"continuous_current_a": 0.001, "heat_a2_s": 1e-6})
    latch = TripLatch("/dev/serial/by-id/some", tmp_path)

    def link() -> LogicLink:
        device = DRIVES[name][1](SimulatedTransport(rig.fake))
        return LogicLink(device, "some", latch=latch)

    hot = pytest.raises(SafetyTripError, match="too high for too long")
    with hot, Session(rig.config, link()) as session:
        next(session.rest(0.1))
        list(moving(session, 1.0, 0.5))
    assert latch.code == Trip.OVERHEATED
    again = pytest.raises(SafetyTripError, match="tripped before")
    with again, Session(rig.config, link()) as session:
        next(session.rest(0.1))
        next(moving(session))
    assert not rig.in_force
    with TeensyLogger(link()) as logger:
        with pytest.raises(DriverError):
            logger.clear(int(Trip.STALLED))
        assert latch.code == Trip.OVERHEATED
        logger.clear(int(Trip.OVERHEATED))
    assert latch.code == 0


def test_a_latch_that_cannot_be_read_is_a_trip(tmp_path):
    latch = TripLatch("a", tmp_path)
    latch.keep(9)
    (file,) = tmp_path.iterdir()
    assert TripLatch("a", tmp_path).code == 9
    assert TripLatch("b", tmp_path).code == 0
    file.write_text("{")
    assert latch.code != 0
