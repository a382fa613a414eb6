"""`rig doctor`, `devices`, `udev`, `stop`, `firmware`: what is found, and what to type."""

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.device import Batch, Device, SampleFlag
from drivers.registry import fakes
from drivers.teensy.core import BoardStart, FirmwareBoard
from drivers.teensy.device import TeensyDevice
from drivers.teensy.fake import PythonBoard
from drivers.teensy.fake_device import HandMovedBench
from drivers.transport.faulty import Fault, Faults
from drivers.transport.simulated import SimulatedTransport
from rig.bench import firmware
from rig.configuration.config import SHIPPED, load_config
from rig.doctor.examine import examine
from rig.doctor.finding import Finding, Level, worst
from rig.doctor.ports import Port, can_interfaces, port_findings
from rig.doctor.stream import device_findings
from rig.doctor.udev import USB, udev_rules
from rig.errors import ExitCode, UsageError
from rig.simulation.bench import SimulatedBench
from tests.rig.simulated import simulated

pytestmark = pytest.mark.integration


def by_check(findings: list[Finding]) -> dict[str, Finding]:
    return {finding.check: finding for finding in findings}


def test_a_sensor_where_the_logger_is_is_examined(tmp_path):
    path = tmp_path / "cell.toml"
    logger = '[logger]\ndriver = "ft300"\nprofile = "sensor"\nurl = "sim://"\n'
    path.write_text(f'name = "cell"\ncalibration = "sensor"\n{logger}')
    found = list(examine(load_config(path)))
    assert {"identity", "sample rate"} <= {f.check for f in found if f.subject == "logger"}
    assert worst(found) is Level.OK


def test_a_board_that_was_restarted_needs_its_reference(monkeypatch, library):
    board = FirmwareBoard(SimulatedBench(), BoardStart(simulated=False), library)
    link = SimulatedTransport(board)
    monkeypatch.setattr("rig.doctor.examine.open_logger", lambda _: link)
    findings = by_check(list(examine(simulated())))
    assert findings["referenced"].fix == "Run: rig reference"


@pytest.mark.parametrize("name", sorted(fakes()))
def test_every_fake_is_healthy_and_at_its_rate(name):
    findings = device_findings(name, lambda: fakes()[name](Faults()))
    assert worst(findings) is Level.OK, findings
    assert by_check(findings)["sample rate"].what.count("Hz") == 2


def test_a_bad_cable_is_a_warning_with_numbers():
    faults = Faults(rates={Fault.CORRUPT: 0.3})
    finding = by_check(device_findings("logger", lambda: fakes()["teensy"](faults)))["link"]
    assert finding.level is Level.WARNING
    assert "crc_errors" in finding.what
    assert "cable" in finding.fix


def test_another_firmware_is_reported_with_the_command_that_fixes_it():
    board = PythonBoard(HandMovedBench(), protocol_hash=0xDEADBEEF)
    (finding,) = device_findings("logger", lambda: TeensyDevice(SimulatedTransport(board)))
    assert (finding.check, finding.level) == ("firmware", Level.ERROR)
    assert finding.fix == "Run: rig firmware flash"


class Changed:
    """A device whose batches go through a function."""

    def __init__(self, device: Device, change: object) -> None:
        self._device, self._change = device, change

    def __getattr__(self, name: str) -> object:
        return getattr(self._device, name)

    def read(self, timeout_s: float) -> Batch:
        return self._change(self._device.read(timeout_s))


def stuck(batch: Batch) -> Batch:
    return replace(batch, columns={**batch.columns, "proximal_count": np.full(len(batch), 5.0)})


def saturated(batch: Batch) -> Batch:
    return replace(batch, flags=batch.flags | np.uint8(SampleFlag.SATURATED))


def slow(batch: Batch) -> Batch:
    return replace(batch, time_s=batch.time_s * 1.1)


def nothing(batch: Batch) -> Batch:
    names = ("time_s", "sequence", "flags")
    return replace(batch, columns={}, **{name: getattr(batch, name)[:0] for name in names})


@pytest.mark.parametrize(
    ("change", "check", "level", "words"),
    [
        (stuck, "stuck", Level.WARNING, "proximal_count did not change"),
        (saturated, "saturation", Level.ERROR, "Saturated in"),
        (slow, "sample rate", Level.ERROR, "909.1 Hz"),
        (nothing, "sample rate", Level.ERROR, "sends nothing"),
    ],
)
def test_what_a_stream_may_have(change, check, level, words):
    findings = device_findings("logger", lambda: Changed(fakes()["teensy"](Faults()), change))
    finding = by_check(findings)[check]
    assert finding.level is level
    assert words in finding.what
    assert finding.fix


def computer(root: Path, files: dict[str, str]) -> Path:
    """A file system as far as the doctor looks into one."""
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True)
        (root / name).write_text(text)
    return root


RULE = {"etc/udev/rules.d/70-rig.rules": udev_rules()}


@pytest.fixture
def port(tmp_path):
    path = tmp_path / "ttyUSB7"
    path.touch()
    return Port(str(path), "16c0:0483:123", "")


@pytest.mark.parametrize("modem_manager", [False, True])
@pytest.mark.parametrize("rule", [{}, RULE])
def test_rules_and_modem_manager(tmp_path, port, rule, modem_manager):
    process = {"proc/42/comm": "ModemManager\n" if modem_manager else "bash\n"}
    findings = by_check(port_findings([port], computer(tmp_path, rule | process)))
    assert ("udev rule" in findings) == (not rule)
    assert ("ModemManager" in findings) == (modem_manager and not rule)
    for finding in findings.values():
        assert finding.level is Level.OK or "rig udev | sudo tee" in finding.fix
    other_peoples = Port("/dev/ttyS0", "", "")
    assert port_findings([other_peoples], tmp_path) == []


def test_who_holds_a_port_is_named(tmp_path, port):
    with Path(port.path).open() as held:
        holder = subprocess.Popen(["sleep", "60"], stdin=held)
    try:
        finding = by_check(port_findings([port], tmp_path))["free"]
    finally:
        holder.terminate()
        holder.wait()
    assert f"PID {holder.pid} (sleep)" in finding.what
    assert finding.fix.endswith(f"kill -TERM {holder.pid}")


def test_a_slow_ftdi_adapter_is_reported(tmp_path, port):
    computer(tmp_path, {"sys/bus/usb-serial/devices/ttyUSB7/latency_timer": "16\n"})
    ftdi = replace(port, usb="0403:6001:A1")
    assert "16 ms" in by_check(port_findings([ftdi], tmp_path))["latency"].what


def test_the_rules_name_every_device():
    for identity in USB:
        vendor, product = identity.split(":")
        assert f'ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}"' in udev_rules()
    assert "0666" not in udev_rules()


def test_can_interfaces_are_known_by_their_kind(tmp_path):
    kinds = {"sys/class/net/can0/type": "280\n", "sys/class/net/eth0/type": "1\n"}
    assert can_interfaces(computer(tmp_path, kinds)) == ["can0"]


def test_the_verbs_speak_to_machines(answered):
    told = answered("doctor")
    assert {told["level"], *(f["level"] for f in told["findings"])} == {"ok"}
    assert "logger" in {f["subject"] for f in told["findings"]}
    assert answered("devices --config canopen")["configured"]["jaw_force"]["driver"] == "ati-can"
    assert answered("stop")["state"] == "disarmed"


def test_a_rig_that_is_not_there_is_named_and_its_state_unknown(tmp_path, answered):
    path = tmp_path / "rig.toml"
    text = (SHIPPED / "reference.toml").read_text()
    path.write_text(text.replace("usb:16c0:0483", "/dev/nonesuch"))
    result = answered("doctor -c", path, code=ExitCode.FAILED)
    assert result["level"] == "error"
    assert "no port /dev/nonesuch" in result["findings"][-1]["what"]
    assert answered("stop -c", path, code=ExitCode.SAFETY)["state"] == "unknown"
    assert not answered("firmware version -c", path, code=ExitCode.FAILED)["fits"]


def test_the_hash_of_the_sources_is_that_of_posix_cksum(library):
    assert firmware.posix_cksum(b"123456789") == 930766865
    versions = firmware.compare(load_config())
    assert versions.fits
    assert versions.sources.removeprefix("build ") in versions.board
    assert versions.remarks == ("Program and board have the same protocol.",)


def test_a_build_of_other_sources_is_reported(library, monkeypatch):
    monkeypatch.setattr(firmware, "source_hash", lambda: 1)
    assert any("rig firmware flash" in r for r in firmware.compare(load_config()).remarks)


def test_flashing_reports_what_is_missing(monkeypatch):
    with pytest.raises(UsageError, match="teensy41"):
        firmware.flash("uno")
    monkeypatch.setattr(firmware.shutil, "which", lambda tool: None)
    with pytest.raises(UsageError, match="platformio"):
        firmware.flash("teensy41")
    with pytest.raises(UsageError, match="make is not installed"):
        firmware.build()
