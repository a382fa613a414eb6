"""A driver of another package: found by its entry point, opened, and named when it is broken."""

import re
import sys
from pathlib import Path

import pytest

from drivers.device import LinkedDevice
from drivers.errors import DriverError
from drivers.registry import UnknownDriverError, broken_drivers, driver, drivers, open_device
from rig.bench.logger import open_section
from rig.cli.main import main
from rig.configuration.check import problems
from rig.configuration.config import SIMULATED, Config, load_config
from rig.doctor.examine import examine
from rig.doctor.finding import Level

MODULE = '''
"""A scale on a serial line."""
import numpy as np
from drivers.device import Batch, Channel, DeviceIdentity
from drivers.errors import PortNotFoundError
from drivers.registry import Driver

def open_scale(url: str, rate_hz: float = 10.0):
    raise PortNotFoundError(f"no scale at {url}, {rate_hz} Hz")

class Scale:
    name = "scale"
    channels = (Channel("force_n", "N", 10.0, -1.0, 1.0, "load"),)
    counters = {}
    def __init__(self, faults):
        self.sent = 0
    def identify(self):
        return DeviceIdentity("scale", "1", "")
    def start(self): ...
    def stop(self): ...
    def close(self): ...
    def read(self, timeout_s):
        numbers = np.array([self.sent])
        self.sent += 1
        zero = np.zeros(1)
        return Batch({"force_n": zero}, zero, "host", numbers, np.zeros(1, np.uint8), 0)

DRIVER = Driver("acme-scale", "ACME bench scale", open_scale)
'''


def install(folder: Path, monkeypatch: pytest.MonkeyPatch, entry: str, *change: str) -> None:
    """Put a package with one driver on the path, as pip would; a changed one has a fake."""
    (folder / "acme_scale.py").write_text(MODULE.replace(*change) if change else MODULE)
    info = folder / "acme-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    fake = "[rig.driver_fakes]\nacme-scale = acme_scale:Scale\n" if change else ""
    (info / "entry_points.txt").write_text(f"[rig.drivers]\nacme-scale = {entry}\n{fake}")
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, "acme_scale", raising=False)


def with_scale(url: str, **options: object) -> Config:
    scale = {"driver": "acme-scale", "url": url, "options": options}
    return load_config().changed(devices={"scale": scale})


def test_it_is_opened_with_its_options_and_a_missing_fake_is_reported(tmp_path, monkeypatch):
    install(tmp_path, monkeypatch, "acme_scale:DRIVER")
    assert drivers()["acme-scale"].options == {"rate_hz": 10.0}
    with pytest.raises(DriverError, match=r"no scale at /dev/ttyS9, 5.0 Hz"):
        open_device("acme-scale", "/dev/ttyS9", rate_hz=5.0)
    assert not problems(with_scale("/dev/ttyS9"))
    (problem,) = problems(with_scale("/dev/ttyS9", colour="red"))
    assert "colour" in problem.what
    config = with_scale("sim://")
    (problem,) = problems(config)
    assert "no fake" in problem.what
    with pytest.raises(DriverError, match="no fake"):
        open_section(config.devices["scale"])


BROKEN = ["acme_scale:NONE", "acme_nonesuch:DRIVER", "acme_scale:open_scale", "acme_bad:DRIVER"]


@pytest.mark.parametrize("entry", BROKEN)
def test_a_broken_one_names_its_package_and_stops_no_other(tmp_path, monkeypatch, entry):
    (tmp_path / "acme_bad.py").write_text("1 / 0")
    install(tmp_path, monkeypatch, entry)
    for open_it in (driver, lambda name: open_device(name, "/dev/ttyS9")):
        with pytest.raises(UnknownDriverError, match=r"acme"):
            open_it("acme-scale")
    (problem,) = problems(with_scale("/dev/ttyS9"))
    assert "acme" in problem.what
    assert set(broken_drivers()) == {"acme-scale"}
    assert "acme-scale" not in drivers()
    assert driver("teensy").name == "teensy"
    assert not problems(load_config())


def test_the_doctor_and_the_list_of_devices_have_a_broken_one(tmp_path, monkeypatch, capsys):
    install(tmp_path, monkeypatch, "acme_nonesuch:DRIVER")
    findings = list(examine(load_config()))
    (broken,) = (f for f in findings if f.subject == "drivers")
    assert broken.level is Level.WARNING
    assert "acme_nonesuch" in broken.what
    assert any(f.subject == "logger" for f in findings)
    assert main(["devices", "--sim"]) == 0
    out = capsys.readouterr().out
    assert "acme_nonesuch" in out
    assert "teensy" in out


FAULTS = {
    "a key": ("self.sent += 1", "self.sent += {}['n']", r"failed: KeyError: 'n'.*in read"),
    "a method": ("def identify", "def identity", "AttributeError.*identify"),
    "the making": ("self.sent = 0", "1 / 0", "ZeroDivisionError"),
    "no identity": ('DeviceIdentity("scale", "1", "")', "None", "NoneType from identify"),
    "a column": ('{"force_n": zero}', '{"force": zero}', "no column force_n"),
    "a shape": ('{"force_n": zero}', '{"force_n": np.zeros(2)}', r"force_n has \(2,\)"),
    "a sequence": ("np.array([self.sent])", "np.arange(2)", r"sequence has \(2,\)"),
    "the unit": ('"force_n", "N"', '"force_n", "lbf"', "'force_n' in 'lbf'"),
    "the channels": ("    channels", "    chanels", "AttributeError.*channels"),
}


@pytest.mark.parametrize(("old", "new", "message"), FAULTS.values(), ids=FAULTS)
@pytest.mark.parametrize("place", ["logger", "beside"])
def test_a_fault_of_one_names_it(tmp_path, monkeypatch, capsys, place, old, new, message):
    install(tmp_path, monkeypatch, "acme_scale:DRIVER", old, new)
    scale = 'driver = "acme-scale"\nurl = "sim://"\n'
    head = 'name = "scale"\ncalibration = "sensor"\n[logger]\nprofile = "sensor"\n'
    if place == "beside":
        head = f"{SIMULATED.read_text()}\n[devices.scale]\n"
    path = tmp_path / "rig.toml"
    path.write_text(head + scale)
    assert main(["record", "-c", str(path), "-o", str(tmp_path / "r")]) == 3
    said = capsys.readouterr().err
    assert re.search(f"driver (acme-scale of acme|scale) .*{message}", said, re.DOTALL)


def test_a_driver_that_cannot_stop_its_device_cannot_be_made():
    class Scale(LinkedDevice):
        name, channels, identify, start, read = "acme-scale", (), None, None, None

    with pytest.raises(TypeError, match="stop"):
        Scale(None, 10.0)
