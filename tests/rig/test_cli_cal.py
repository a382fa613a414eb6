"""`rig cal`: from a certificate to the calibration of a session."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from calibration.record import Validity
from calibration.store import CalibrationStore
from rig.bench.session import Session
from rig.cli.main import main
from rig.configuration.config import SIMULATED, load_config
from rig.recording.campaign import open_campaign_folder, record_campaign
from tests.rig.simulated import short_protocol, simulated, transport

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
def rig(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("RIG_CALIBRATIONS", str(tmp_path / "store"))

    def run(*words):
        code = main([*words, "--json"])
        return code, json.loads(capsys.readouterr().out)

    return run


def certificate(tmp_path, slope="4.0e-5"):
    path = tmp_path / f"certificate{slope}.toml"
    path.write_text(CERTIFICATE.replace("4.0e-5", slope))
    return str(path)


def configuration(tmp_path, serial):
    path = tmp_path / "rig.toml"
    keys = f'calibration_store = "default"\nserials = {{ proximal_sensor = "{serial}" }}\n'
    path.write_text(keys + SIMULATED.read_text())
    return path


def test_from_a_certificate_to_a_session(rig, tmp_path):
    code, added = rig("cal", "add", certificate(tmp_path), "--operator", "Ada",
                      "--serial", "proximal_sensor=F7")  # fmt: skip
    digest = added["added"]["proximal_torque_n_m"]
    assert code == 0
    assert load_config(configuration(tmp_path, "F7")).calibration_set().name == "reference"

    assert rig("cal", "use", digest[:8], "--by", "Ada")[1]["replaced"] is None
    calibrations = load_config(configuration(tmp_path, "F7")).calibration_set()
    assert calibrations.channels["proximal_torque_n_m"].slope == 4.0e-5
    listed = rig("cal", "list")[1]["records"]
    assert [(r["hash"], r["active"]) for r in listed] == [(digest, True)]
    assert rig("cal", "show", digest)[1]["record"]["operator"] == "Ada"


def test_a_foreign_sensor_is_refused_by_check_and_by_the_session(rig, tmp_path):
    _, added = rig("cal", "add", certificate(tmp_path), "--operator", "Ada",
                   "--serial", "proximal_sensor=F7")  # fmt: skip
    rig("cal", "use", *added["added"].values(), "--by", "Ada")
    path = configuration(tmp_path, "F8")
    code, said = rig("cal", "check", "--config", str(path), "--store", str(tmp_path / "store"))
    assert code == 1
    assert [v["rule"] for v in said["verdicts"]] == ["foreign_serial"]
    code, said = rig("record", "--config", str(path), "--out", str(tmp_path / "runs"))
    assert code == 5
    assert "must not be used" in said["error"]["what"]
    assert not (tmp_path / "runs").exists()


def test_diff_names_what_changed(rig, tmp_path, capsys):
    hashes = []
    for slope in ("4.0e-5", "4.1e-5"):
        words = (certificate(tmp_path, slope), "--operator", "Ada", "--made-at")
        _, added = rig("cal", "add", *words, "2026-03-01T12:00:00+00:00")
        hashes += added["added"].values()
    _, told = rig("cal", "diff", *hashes)
    assert told["changes"]["fit.parameters.slope"] == {"first": 4.0e-5, "second": 4.1e-5}
    assert set(told["changes"]) == {"hash", "fit.parameters.slope", "raw"}
    assert main(["cal", "diff", *hashes]) == 0
    assert "slope: 40 uN m a count -> 41 uN m a count" in capsys.readouterr().out
    assert main(["cal", "list"]) == 0
    assert "slope 40 uN m a count" in capsys.readouterr().out


def test_records_of_the_simulated_rig_are_listed_by_their_gains_and_found(
    monkeypatch, tmp_path, capsys
):
    monkeypatch.setenv("RIG_CALIBRATIONS", str(tmp_path / "store"))
    monkeypatch.chdir(tmp_path)
    assert main(["calibrate", "current", "--sim", "--yes", "--operator", "Ada"]) == 0
    out = capsys.readouterr().out
    hints = [line for line in out.splitlines() if line.startswith("Use it:")]
    assert [main(hint.partition("rig ")[2].split()) for hint in hints] == [0, 0]
    said = " ".join(out.split())
    capsys.readouterr()
    assert f'calibration_store = "{tmp_path / "store-simulated"}"' in said
    assert main(["cal", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].endswith("store-simulated")
    constant, gain = sorted(lines[1:3], key=lambda line: "motor_current_a" in line)
    assert re.search(r"SIM-TOOL-1: torque_constant_n_m_a 8\d\d\.\d mN m/A", constant)
    assert re.search(r": gain_a 2\.\d+ A", gain)
    assert main(["cal", "show", constant.split()[1]]) == 0
    said = capsys.readouterr().out
    assert re.search(r"torque_constant_n_m_a: 8\d\d\.\d mN m/A \+- ", said)
    assert "covariance" not in said
    assert main(["cal", "use", constant.split()[1], "--by", "Ada"]) == 0
    assert not (tmp_path / "store").exists()


def test_a_log_beyond_the_calibrated_range_is_reported(rig, tmp_path):
    config = simulated()
    plans = open_campaign_folder(tmp_path / "runs", short_protocol(1), config, resume=False)
    with Session(config, transport(config)) as session:
        (run,) = record_campaign(session, plans, tmp_path / "runs")
    _, added = rig("cal", "add", certificate(tmp_path), "--operator", "Ada")
    store = CalibrationStore(tmp_path / "store")
    narrow = replace(store.get(*added["added"].values()), validity=Validity(-1.0, 1.0))
    store.use(store.add(narrow), narrow.made_at, "Ada")
    code, said = rig("cal", "check", "--log", str(run.path), "--store", str(tmp_path / "store"))
    assert code == 0
    assert [v["rule"] for v in said["verdicts"]] == ["out_of_range"]
    assert rig("cal", "check", "--store", str(tmp_path / "store"))[1]["verdicts"] == []


def test_a_log_is_exported_with_another_record(rig, tmp_path):
    """Twice the slope is twice the torque; the zero that was measured before the run stays."""
    short = tmp_path / "short.toml"
    short.write_text(
        'name = "short"\n[[runs]]\nkind = "sine"\nfrequencies_hz = [1.0]\nloads_a = [0.2]\n'
        "duration_s = 1.0\n"
    )
    rig("record", "-p", str(short), "--out", str(tmp_path / "runs"))
    (log,) = (tmp_path / "runs").glob("*.mcap")
    _, added = rig("cal", "add", certificate(tmp_path, "7.9622e-05"), "--operator", "Ada")
    digest = added["added"]["proximal_torque_n_m"]
    torques = []
    for words in ([], ["--record", digest], ["--calibration", "reference"]):
        target = tmp_path / f"sample{len(torques)}.npz"
        code, said = rig("log", "export", str(log), "--topic", "/rig/sample", "--format", "npz",
                         "--out", str(target), *words)  # fmt: skip
        assert code == 0
        torques.append(np.load(target)["proximal_torque_n_m"])
    assert said["calibrations"]["reference"]
    np.testing.assert_allclose(torques[1], 2 * torques[0], rtol=1e-12)
    np.testing.assert_array_equal(torques[2], torques[0])
    code, said = rig("log", "export", str(log), "--record", "ffff")
    assert code == 2
