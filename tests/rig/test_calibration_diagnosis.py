"""What a calibration lacks is found by the same diagnosis as everything else, of each kind."""

import json
from pathlib import Path

import pytest

from rig.calibrate.hands import HandledBench
from rig.cli.main import main
from rig.configuration.config import SIMULATED

pytestmark = pytest.mark.long


@pytest.fixture
def rig(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("RIG_CALIBRATIONS", str(tmp_path / "store"))
    monkeypatch.setenv("RIG_STATE_DIR", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)

    def run(*words):
        assert main([*words]) == 0
        return json.loads(capsys.readouterr().out)

    def calibrated(kind, *words, hidden="{}"):
        """Calibrate a rig without hidden losses but those given."""
        text = SIMULATED.read_text()
        text = text.replace("seed = 0", f'seed = 0\nplant = "declared"\nhidden = {hidden}')
        (tmp_path / "rig.toml").write_text(text)
        how = ["--operator", "Ada", "--yes", "--json", "--config", "rig.toml", "--out", "raw"]
        how += ["--store", "store"]
        return run("calibrate", kind, *words, *how)["records"]

    calibrated.run = run
    return calibrated


def families(found):
    """Return the equation and the likeliest family of each finding."""
    return [(f["balance"], f["family"]) for f in found["findings"]]


@pytest.mark.parametrize(
    ("kind", "words", "hidden", "family"),
    [
        ("gearbox", ["--stiffness-only"], "{ gear_backlash = 1.0 }", "transmission.backlash"),
        ("encoder", ["--which", "jaw", "--line-only"], "{ jaw_encoder_wave = 1.0 }",
                     "sensor.encoder_inl"),
    ],
)  # fmt: skip
def test_what_a_parts_calibration_leaves_out_is_named(rig, kind, words, hidden, family):
    records = rig(kind, *words, hidden=hidden)
    wanted = [(f"calibration.{kind}", family)]
    digest = next(d for d, r in records.items() if r["channel"] != "jaw_angle_rad")
    assert families(rig.run("cal", "diagnose", digest, "--json")) == wanted
    if kind == "encoder":  # the same from the folder of raw logs, as any other recordings
        assert families(rig.run("diagnose", "raw", "--json", "--ledger", "other")) == wanted


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("gearbox", []),
        ("encoder", ["--which", "jaw"]),
        ("current", []),
        ("torque", ["--repeats", "4"]),
        ("ft", ["--repeats", "3"]),
    ],
)
def test_a_calibration_that_lacks_nothing_has_no_finding(rig, kind, words):
    rig(kind, *words)
    assert families(rig.run("diagnose", "raw", "--json")) == []


def test_a_torque_sensor_with_a_kink_is_named(rig, monkeypatch):
    hang = HandledBench.hang

    def kinked(self, sensor, torque_n_m):
        hang(self, sensor, torque_n_m - 0.03 * max(torque_n_m - 0.12, 0.0))

    monkeypatch.setattr(HandledBench, "hang", kinked)
    (digest,) = rig("torque", "--repeats", "4")
    found = families(rig.run("cal", "diagnose", digest, "--json"))
    assert found == [("calibration.torque", "sensor.gain_nonlinear")]


def test_a_gap_that_was_modelled_is_not_found_again(rig):
    (digest,) = rig("gearbox", hidden="{ gear_backlash = 1.0 }")
    assert families(rig.run("cal", "diagnose", digest, "--json")) == []


def test_only_raw_logs_can_be_diagnosed(rig, capsys):
    records = rig("current")
    driver = next(d for d, r in records.items() if r["channel"] == "motor_current_a")
    assert main(["cal", "diagnose", driver]) == 2
    assert "spindle_torque_n_m" in capsys.readouterr().err
    for log in Path("raw").glob("*.mcap"):
        log.unlink()
    assert main(["cal", "diagnose", driver]) == 2
    assert "not where they were" in capsys.readouterr().err
