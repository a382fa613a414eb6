"""Counts to SI: lines, the hash of their set, zeros at rest and their drift, clear refusals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.errors import CalibrationError
from calibration.linear import (
    CalibrationSet,
    LinearCalibration,
    load_calibration_set,
    shipped_calibration_set,
)
from calibration.zero import drift_verdicts, measure_zeros

COUNTS = np.dtype([("distal", "<i2"), ("motor", "<i4")])
TORQUE, MOTOR = "distal_torque_n_m", "motor_angle_rad"
SET = CalibrationSet(
    "test",
    {
        TORQUE: LinearCalibration(TORQUE, "distal", -1e-3, 10.0, tared=True),
        MOTOR: LinearCalibration(MOTOR, "motor", 1e-3),
    },
)
finite = st.floats(-1e6, 1e6).filter(lambda x: abs(x) > 1e-9)


def rest(mean: float, count: int = 500) -> np.ndarray:
    counts = np.zeros(count, COUNTS)
    counts["distal"] = np.round(mean + np.random.default_rng(0).normal(0, 2, count))
    return counts


@given(finite, st.floats(-1e4, 1e4), st.lists(st.integers(-32768, 32767), min_size=1))
def test_the_line_is_applied_with_its_own_zero_or_a_measured_one(slope, zero, values):
    counts = np.zeros(len(values), COUNTS)
    counts["distal"] = values
    lines = CalibrationSet("test", {TORQUE: LinearCalibration(TORQUE, "distal", slope, zero)})
    for zeros, expected in (({}, zero), ({TORQUE: 100.0}, 100.0)):
        columns = lines.apply(counts, zeros)
        np.testing.assert_allclose(columns[TORQUE], (np.array(values, float) - expected) * slope)


def test_the_hash_is_of_the_content_and_survives_a_round_trip():
    shipped = shipped_calibration_set("reference")
    again = CalibrationSet.from_json(shipped.to_json())
    assert again == shipped
    assert again.content_hash == shipped.content_hash
    line = LinearCalibration("motor_current_a", "current", 2e-3)
    other = CalibrationSet(shipped.name, {**shipped.channels, line.channel: line})
    assert other.content_hash != shipped.content_hash


def test_closing_is_positive_in_the_reference_set():
    lines = shipped_calibration_set("reference").channels
    falls = {"spindle_angle_rad", "target_angle_rad", "distal_torque_n_m", "motor_command_ratio"}
    assert {name for name, line in lines.items() if line.slope < 0} == falls


def test_what_is_no_line_or_no_set_is_refused(tmp_path):
    for slope in (0.0, float("nan"), float("inf")):
        with pytest.raises(CalibrationError, match="do not make a line"):
            LinearCalibration("motor_current_a", "current", slope)
    for text in ("", "{}", '{"name": "x", "channels": {"a": {}}}', "[1]"):
        with pytest.raises(CalibrationError, match="not a calibration set"):
            CalibrationSet.from_json(text)
    path = tmp_path / "c.toml"
    path.write_text('name = "x"\n[channels.motor_current_a]\ncounts = "current"\nslop = 1.0\n')
    for file, message in ((path, "slop"), (tmp_path / "absent.toml", "cannot be read")):
        with pytest.raises(CalibrationError, match=message):
            load_calibration_set(file)


@pytest.mark.parametrize(("after", "passes"), [(41.0, True), (60.0, False), (20.0, False)])
def test_the_zero_of_a_tared_channel_may_drift_up_to_its_limit(after, passes):
    before, last = measure_zeros(rest(40.0), SET), measure_zeros(rest(after), SET)
    assert set(before) == {TORQUE}
    assert before[TORQUE] == pytest.approx(40.0, abs=0.5)
    (verdict,) = drift_verdicts(before, last, SET, {TORQUE: 5e-3})
    assert verdict.passes is passes
    assert verdict.after - verdict.before == pytest.approx(-(after - 40.0) * 1e-3, abs=1e-9)
    assert verdict.unit == "N m"


def test_what_is_no_zero_is_refused():
    with pytest.raises(CalibrationError, match="too few"):
        measure_zeros(rest(0.0, 99), SET)
    dead = rest(0.0)
    dead["distal"] = 40  # a dead input reads one number for ever; its mean would pass for a zero
    with pytest.raises(CalibrationError, match="500 times the same"):
        measure_zeros(dead, SET)
    zeros = measure_zeros(rest(0.0), SET)
    with pytest.raises(CalibrationError, match="has a drift limit but no zero"):
        drift_verdicts(zeros, zeros, SET, {MOTOR: 1.0})
