"""What a calibration lacks is found by the same diagnosis as everything else, of each kind."""

from pathlib import Path

import pytest

from rig.calibrate.hands import HandledBench
from rig.configuration.config import SIMULATED

pytestmark = pytest.mark.long


@pytest.fixture
def rig(tmp_path, monkeypatch, answered):
    """Calibrate a rig without hidden losses but those given."""
    monkeypatch.setenv("RIG_CALIBRATIONS", str(tmp_path / "store"))
    monkeypatch.setenv("RIG_STATE_DIR", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)
    how = "--operator Ada --yes --config rig.toml --out raw --store store"

    def calibrated(kind, words="", hidden="{}"):
        text = SIMULATED.read_text()
        text = text.replace("seed = 0", f'seed = 0\nplant = "declared"\nhidden = {hidden}')
        (tmp_path / "rig.toml").write_text(text)
        return answered("calibrate", kind, words, how)["records"]

    return calibrated


@pytest.fixture
def families(answered):
    """Diagnose; return the equation and the likeliest family of each finding."""
    return lambda *words: [(f["balance"], f["family"]) for f in answered(*words)["findings"]]


@pytest.mark.parametrize(
    ("kind", "words", "hidden", "family"),
    [
        ("gearbox", "--stiffness-only", "{ gear_backlash = 1.0 }", "transmission.backlash"),
        ("encoder", "--which jaw --line-only", "{ jaw_encoder_wave = 1.0 }",
                     "sensor.encoder_inl"),
    ],
)  # fmt: skip
def test_what_a_parts_calibration_leaves_out_is_named(rig, families, kind, words, hidden, family):
    records = rig(kind, words, hidden=hidden)
    wanted = [(f"calibration.{kind}", family)]
    digest = next(d for d, r in records.items() if r["channel"] != "jaw_angle_rad")
    assert families("cal diagnose", digest) == wanted
    if kind == "encoder":  # the same from the folder of raw logs, as any other recordings
        assert families("diagnose raw --ledger other") == wanted


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("gearbox", ""),
        ("encoder", "--which jaw"),
        ("current", ""),
        ("torque", "--repeats 4"),
        ("ft", "--repeats 3"),
    ],
)
def test_a_calibration_that_lacks_nothing_has_no_finding(rig, families, kind, words):
    rig(kind, words)
    assert families("diagnose raw") == []


def test_a_torque_sensor_with_a_kink_is_named(rig, families, monkeypatch):
    hang = HandledBench.hang

    def kinked(self, sensor, torque_n_m):
        hang(self, sensor, torque_n_m - 0.03 * max(torque_n_m - 0.12, 0.0))

    monkeypatch.setattr(HandledBench, "hang", kinked)
    (digest,) = rig("torque", "--repeats 4")
    assert families("cal diagnose", digest) == [("calibration.torque", "sensor.gain_nonlinear")]


def test_a_gap_that_was_modelled_is_not_found_again(rig, families):
    (digest,) = rig("gearbox", hidden="{ gear_backlash = 1.0 }")
    assert families("cal diagnose", digest) == []


def test_only_raw_logs_can_be_diagnosed(rig, said):
    records = rig("current")
    driver = next(d for d, r in records.items() if r["channel"] == "motor_current_a")
    assert "spindle_torque_n_m" in said("cal diagnose", driver, code=2).err
    for log in Path("raw").glob("*.mcap"):
        log.unlink()
    assert "not where they were" in said("cal diagnose", driver, code=2).err
