"""`rig calibrate add, use, ...`: from a certificate to the calibration of a session."""

import re
from dataclasses import replace

import numpy as np
import pytest

from calibration.record import Validity
from calibration.store import CalibrationStore
from rig.configuration.config import SIMULATED, load_config
from tests.rig.simulated import protocol_file

pytestmark = pytest.mark.integration

CERTIFICATE = """
name = "certificate"
[channels.proximal_torque_n_m]
counts = "proximal"
slope = 4.0e-5
zero_counts = 3.0
tared = true
source = "certificate 4711"
"""


@pytest.fixture
def rig(tmp_path, monkeypatch, answered):
    monkeypatch.setenv("RIG_CALIBRATIONS", str(tmp_path / "store"))
    return answered


@pytest.fixture
def added(rig, tmp_path):
    """Add a certificate with a slope; return the hash of its record."""

    def add(slope="4.0e-5", more=""):
        path = tmp_path / f"certificate{slope}.toml"
        path.write_text(CERTIFICATE.replace("4.0e-5", slope))
        said = rig("calibrate add", path, "--operator Ada", more)
        return said["added"]["proximal_torque_n_m"]

    return add


@pytest.fixture
def log(rig, tmp_path):
    rig("record -p", protocol_file(tmp_path), "--out", tmp_path / "runs")
    (log,) = (tmp_path / "runs").glob("*.mcap")
    return log


def configuration(tmp_path, serial):
    path = tmp_path / "rig.toml"
    keys = f'calibration_store = "default"\nserials = {{ proximal_sensor = "{serial}" }}\n'
    path.write_text(keys + SIMULATED.read_text())
    return path


def test_from_a_certificate_to_a_session(rig, added, tmp_path):
    digest = added(more="--serial proximal_sensor=F7")
    assert load_config(configuration(tmp_path, "F7")).calibration_set().name == "reference"
    assert rig("calibrate use", digest[:8], "--by Ada")["replaced"] is None
    calibrations = load_config(configuration(tmp_path, "F7")).calibration_set()
    assert calibrations.channels["proximal_torque_n_m"].slope == 4.0e-5
    listed = rig("calibrate list")["records"]
    assert [(r["hash"], r["active"]) for r in listed] == [(digest, True)]
    assert rig("calibrate show", digest)["record"]["operator"] == "Ada"


def test_a_foreign_sensor_is_refused_by_check_and_by_the_session(rig, added, tmp_path):
    rig("calibrate use", added(more="--serial proximal_sensor=F7"), "--by Ada")
    path = configuration(tmp_path, "F8")
    told = rig("calibrate check --config", path, "--store", tmp_path / "store", code=1)
    assert [v["rule"] for v in told["verdicts"]] == ["foreign_serial"]
    told = rig("record --config", path, "--out", tmp_path / "runs", code=5)
    assert "must not be used" in told["error"]["what"]
    assert not (tmp_path / "runs").exists()


def test_diff_names_what_changed(rig, added, said):
    hashes = [added(slope, "--made-at 2026-03-01T12:00:00+00:00") for slope in ("4.0e-5", "4.1e-5")]
    told = rig("calibrate diff", *hashes)
    assert told["changes"]["fit.parameters.slope"] == {"first": 4.0e-5, "second": 4.1e-5}
    assert set(told["changes"]) == {"hash", "fit.parameters.slope", "raw"}
    out = said("calibrate diff", *hashes).out
    assert "slope: 40 uN m a count -> 41 uN m a count" in out
    assert "slope 40 uN m a count" in said("cal list").out  # the name it had


def test_records_of_the_simulated_rig_are_listed_by_their_gains_found_and_shown_with_units(
    rig, monkeypatch, tmp_path, said
):
    monkeypatch.chdir(tmp_path)
    out = said("calibrate current --sim --yes --operator Ada").out
    hints = [line for line in out.splitlines() if line.startswith("Use it:")]
    assert len(hints) == 2
    for hint in hints:
        said(hint.partition("rig ")[2])
    assert f'calibration_store = "{tmp_path / "store-simulated"}"' in " ".join(out.split())
    lines = said("calibrate list").out.splitlines()
    assert lines[0].endswith("store-simulated")
    constant, gain = sorted(lines[1:3], key=lambda line: "motor_current_a" in line)
    assert re.search(r"SIM-TOOL-1: torque_constant_n_m_a 8\d\d\.\d mN m/A", constant)
    assert re.search(r": gain_a 2\.\d+ A", gain)
    shown = said("calibrate show", constant.split()[1]).out
    assert re.search(r"torque_constant_n_m_a: 8\d\d\.\d mN m/A \+- ", shown)
    assert "covariance" not in shown
    said("calibrate use", constant.split()[1], "--by Ada")
    assert not (tmp_path / "store").exists()


def test_a_log_beyond_the_calibrated_range_is_reported(rig, added, log, tmp_path):
    store = CalibrationStore(tmp_path / "store")
    narrow = replace(store.get(added()), validity=Validity(-1.0, 1.0))
    store.use(store.add(narrow), narrow.made_at, "Ada")
    checked = rig("calibrate check --store", store.folder, "--log", log)
    assert [v["rule"] for v in checked["verdicts"]] == ["out_of_range"]
    assert rig("calibrate check --store", store.folder)["verdicts"] == []


def test_a_log_is_exported_with_another_record(rig, added, log, tmp_path):
    """Twice the slope is twice the torque; the zero that was measured before the run stays."""
    digest = added("7.9622e-05")
    torques = []
    for words in ("", f"--record {digest}", "--calibration reference"):
        target = tmp_path / f"sample{len(torques)}.npz"
        told = rig("log export", log, "--topic /rig/sample --format npz", words, "--out", target)
        torques.append(np.load(target)["proximal_torque_n_m"])
    assert told["calibrations"]["reference"]
    np.testing.assert_allclose(torques[1], 2 * torques[0], rtol=1e-12)
    np.testing.assert_array_equal(torques[2], torques[0])
    rig("log export", log, "--record ffff", code=2)
