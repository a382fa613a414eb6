"""What every registered driver keeps, on its own fake: found by the registry, none left out."""

import inspect
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from benchmarks.reliability.fault_names import EVIDENCE, SAID
from drivers.amt21.driver import Amt21
from drivers.device import Batch, Device, SampleFlag
from drivers.errors import DriverError, LinkError, LinkLostError, LinkTimeoutError
from drivers.registry import DRIVERS, Driver, drivers, fakes, open_device
from drivers.teensy.device import TeensyDevice
from drivers.teensy.fake import PythonBoard
from drivers.teensy.grasper import GRASPER
from drivers.teensy.logic import GRASPER_LOGIC
from drivers.teensy_master.fake import TurnedByHand
from drivers.transport.faulty import Fault, Faults, FaultyTransport
from drivers.transport.simulated import SimulatedTransport
from estimation.channels import UNIT_BY_SUFFIX, unit_of
from tests.drivers.emulated_board import MISSING
from tests.drivers.emulated_board import open_fake as open_emulated

pytestmark = pytest.mark.integration

NAMES = sorted(drivers())
EMULATED = "teensy on a Cortex-M4"
GRASPER_BOARD = "teensy at a grasper"
PLACES = [
    *NAMES,
    GRASPER_BOARD,
    pytest.param(EMULATED, marks=pytest.mark.skipif(bool(MISSING), reason=MISSING)),
]
"""Every driver on its fake, and the logger's on a grasper's board and on an emulated processor."""
PROJECT = Path(__file__).parents[2] / "pyproject.toml"
STRIKES = 8


def opened(name: str, faults: Faults | None = None) -> Device:
    own = {EMULATED: open_emulated, GRASPER_BOARD: open_grasper}
    open_fake = own[name] if name in own else fakes()[name]
    return open_fake(faults or Faults())


def open_grasper(faults: Faults) -> Device:
    """Open the logger's driver on a grasper's board, its sensors turned by hand."""
    board = PythonBoard(TurnedByHand(), logic=GRASPER_LOGIC)
    link = SimulatedTransport(board, "sim://grasper", tick_s=GRASPER.tick_us * 1e-6)
    return TeensyDevice(FaultyTransport(link, faults), profile=GRASPER)


def troubles(device: Device) -> int:
    return sum(count for name, count in device.counters.items() if name != "frames")


def read_some(device: Device, wanted: int, reads: int = 400) -> list[Batch]:
    """Read until `wanted` samples have come, however many reads may come back empty."""
    batches: list[Batch] = []
    for _ in range(reads):
        batches.append(device.read(0.1))
        if sum(len(batch) for batch in batches) >= wanted:
            return batches
    pytest.fail(f"{wanted} samples did not come in {reads} reads: {dict(device.counters)}")


def read_on(device: Device, longer_s: float) -> list[Batch]:
    """Read until samples have come that are `longer_s` younger than the first that comes."""
    batches = read_some(device, 1)
    until_s = batches[-1].time_s[0] + longer_s
    while not len(batches[-1]) or batches[-1].time_s[-1] < until_s:
        batches += read_some(device, 1, reads=1000)
    return batches


def check(device: Device, batches: list[Batch]) -> None:
    """Hold batches against what a batch promises."""
    channels = {channel.name: channel for channel in device.channels}
    for channel in device.channels:
        if channel.unit in UNIT_BY_SUFFIX.values() and channel.unit != "1":
            assert unit_of(channel.name) == channel.unit  # else a recording cannot have it
    sequence = np.concatenate([batch.sequence for batch in batches])
    time_s = np.concatenate([batch.time_s for batch in batches])
    assert (np.diff(sequence) > 0).all()
    assert (np.diff(time_s) >= 0).all()
    assert len({batch.clock for batch in batches}) == 1
    lost = [batch.lost for batch in batches]
    assert lost == sorted(lost)
    for batch in batches:
        assert set(batch.columns) == set(channels)
        assert batch.flags.dtype == np.uint8
        good = (batch.flags & ~np.uint8(SampleFlag.STALE)) == 0
        for name, values in batch.columns.items():
            assert values.dtype == np.float64
            assert values.shape == batch.time_s.shape == batch.sequence.shape == batch.flags.shape
            assert np.isfinite(values[good]).all()
            assert (values[good] >= channels[name].lower).all()
            assert (values[good] <= channels[name].upper).all()


def test_the_built_in_drivers_are_installed():
    declared = tomllib.loads(PROJECT.read_text())["project"]["entry-points"][DRIVERS]
    assert set(declared) <= set(NAMES), "install the project again: make setup"
    assert set(NAMES) == set(fakes())
    assert set(declared) == set(SAID)


@pytest.mark.parametrize("name", NAMES)
def test_it_is_documented(name):
    driver = drivers()[name]
    assert isinstance(driver, Driver)
    assert driver.description
    assert all(default is not inspect.Parameter.empty for default in driver.options.values())
    readme = Path(inspect.getfile(inspect.unwrap(driver.open))).with_name("README.md").read_text()
    for heading in ("## Wiring", "## Limits", "## Source"):
        assert heading in readme
    limits = readme.split("## Limits")[1].split("\n## ")[0]
    said = SAID.get(name, {})  # of a driver of another package no words are declared
    assert set(said) in (set(), set(Fault) - {Fault.DISCONNECT})
    for counter in set().union(*said.values()):
        assert f"`{counter}`" in limits, f"{name}'s README does not say what {counter} means"


@pytest.mark.parametrize("name", PLACES)
def test_it_identifies_itself_streams_and_opens_again(name):
    for _ in range(2):
        device = opened(name)
        assert isinstance(device, Device)
        assert device.name == name.split()[0]
        assert device.identify().model
        device.start()
        assert device.channels
        for channel in device.channels:
            assert all((channel.name, channel.unit, channel.description))
            assert channel.rate_hz > 0
            assert channel.lower < channel.upper
        assert len({channel.name for channel in device.channels}) == len(device.channels)
        batches = read_some(device, 60)
        check(device, batches)
        assert next(batch for batch in batches if len(batch)).sequence[0] == 0
        assert batches[-1].lost == 0
        assert troubles(device) == 0, dict(device.counters)
        assert device.counters["frames"] > 0
        device.stop()
        device.start()
        again = read_some(device, 5)
        assert again[0].lost == 0
        assert next(batch for batch in again if len(batch)).sequence[0] == 0
        device.close()
        device.close()
        with pytest.raises(LinkLostError):
            device.read(0.1)


@pytest.mark.parametrize("fault", [fault for fault in Fault if fault is not Fault.DISCONNECT])
@pytest.mark.parametrize("name", PLACES)
def test_it_survives_a_fault_and_names_it(name, fault):
    faults = Faults(seed=2)
    device = opened(name, faults)
    device.start()
    rate_hz = device.channels[0].rate_hz
    batches = read_some(device, 30)
    before = dict(device.counters)
    duration_s = max(0.3, 10 / rate_hz)
    faults.inject(fault, STRIKES, duration_s=duration_s)
    batches += read_on(device, 3 * duration_s)
    assert faults.struck[fault] > 0
    rose = {kind for kind, count in device.counters.items() if count > before[kind]} - EVIDENCE
    said = SAID.get(name if name in NAMES else device.name)
    assert rose if said is None else rose == said[fault]  # no words are declared of a foreign one
    settled = troubles(device)
    batches += read_some(device, 30)
    assert troubles(device) == settled, "the fault is over and the driver still stumbles"
    check(device, batches)
    device.close()


@pytest.mark.parametrize("name", PLACES)
def test_a_cut_link_is_reported_and_it_can_be_opened_again(name):
    faults = Faults()
    device = opened(name, faults)
    device.start()
    read_some(device, 10)
    faults.inject(Fault.DISCONNECT)
    for _ in range(2):
        with pytest.raises(LinkLostError, match="is gone"):
            device.read(0.1)
    device.close()
    again = opened(name)
    again.start()
    check(again, read_some(again, 10))
    again.close()


SILENCE = {
    "amt21": "address 0x54",
    "ati-can": r"base 0x20.*250 kbit/s",
    "ati-serial": "even parity",
    "dynamixel": "identifier 1",
    "ft300": "24 V",
    "moteus": "identifier 1",
    "qia128": "bit rate",
    "teensy": "sim://",
    "teensy-master": "sim://",
    "usb520": "plug it in again",
}
"""What the error names where nobody answers; the others are in tests of their own."""


@pytest.mark.parametrize("name", SILENCE)
def test_a_device_that_does_not_answer_is_an_error_and_is_not_read_unasked(name):
    faults = Faults()
    faults.inject(Fault.STALL, duration_s=1e6)
    device = opened(name, faults)
    if not isinstance(device, TeensyDevice | Amt21):
        with pytest.raises(DriverError, match="Call start"):
            device.read(0.1)
    with pytest.raises(LinkTimeoutError, match=SILENCE[name]):
        device.identify()


def test_an_unknown_driver_or_option_is_named():
    with pytest.raises(DriverError, match=r"no driver 'nonesuch'.*teensy"):
        open_device("nonesuch", "/dev/null")
    with pytest.raises(DriverError, match="no option colour"):
        open_device("teensy", "/dev/null", colour="red")


IMPOSSIBLE = (
    ("amt21", "address", 0x55, "multiple of 4"),
    ("ati-can", "base", 128, "a base identifier lies"),
    ("ati-can", "calibration", 16, "a calibration has a number"),
    ("ati-can", "rate_hz", 0.0, "a rate is above 0"),
    ("dynamixel", "device_id", 253, "an identifier lies"),
    ("dynamixel", "watchdog_ms", 10, "a watchdog has"),
    ("epos4", "node_id", 0, "node number lies"),
    ("epos4", "node_id", 127, "node number lies"),
    ("epos4", "rate_hz", 0.0, "a rate is above 0"),
    ("moteus", "device_id", 127, "an identifier lies"),
)
"""Values of options that no such device can have."""


@pytest.mark.parametrize(("name", "option", "value", "words"), IMPOSSIBLE)
def test_options_that_are_no_such_devices_are_refused(name, option, value, words):
    url = "can:virtual:options" if drivers()[name].can else "loop://"
    with pytest.raises(LinkError, match=words):
        open_device(name, url, **{option: value})


ROOM = PROJECT.parent / "drivers"
FAKES = {path.stem for path in ROOM.rglob("*fake*.py")}
IMPORT = re.compile(r"^\s*(?:from|import) (drivers\.\S+)(?: import (.+))?", re.MULTILINE)


def test_no_driver_imports_a_fake():
    assert "fake" in FAKES
    for path in ROOM.rglob("*.py"):
        if path.stem not in FAKES:
            for module, names in IMPORT.findall(path.read_text()):
                words = {*module.split("."), *re.findall(r"\w+", names)}
                assert not words & FAKES, f"{path} imports {module}"
