"""Linear calibrations: counts to SI, immutable content hash, clear refusals."""

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

COUNTS = np.dtype([("proximal", "<i2"), ("distal", "<i2")])
finite = st.floats(-1e6, 1e6, allow_nan=False).filter(lambda x: abs(x) > 1e-9)


@given(finite, st.floats(-1e4, 1e4), st.lists(st.integers(-32768, 32767), min_size=1))
def test_the_line_is_applied(slope, zero, values):
    counts = np.zeros(len(values), COUNTS)
    counts["proximal"] = values
    line = LinearCalibration("proximal_torque_n_m", "proximal", slope, zero)
    columns = CalibrationSet("test", {line.channel: line}).apply(counts)
    np.testing.assert_allclose(
        columns["proximal_torque_n_m"], (np.array(values, float) - zero) * slope
    )


def test_a_measured_zero_takes_the_place_of_the_lines_own():
    counts = np.zeros(3, COUNTS)
    counts["proximal"] = 110
    line = LinearCalibration("proximal_torque_n_m", "proximal", 0.5, 10.0)
    columns = CalibrationSet("t", {line.channel: line}).apply(counts, {line.channel: 100.0})
    np.testing.assert_allclose(columns["proximal_torque_n_m"], 5.0)


def test_the_hash_is_of_the_content_and_survives_a_round_trip():
    shipped = shipped_calibration_set("reference")
    again = CalibrationSet.from_json(shipped.to_json())
    assert again == shipped
    assert again.content_hash == shipped.content_hash
    line = shipped.channels["motor_current_a"]
    other = CalibrationSet(
        shipped.name,
        {**shipped.channels, line.channel: LinearCalibration(line.channel, line.counts, 2e-3)},
    )
    assert other.content_hash != shipped.content_hash


def test_closing_is_positive_in_the_reference_set():
    lines = shipped_calibration_set("reference").channels
    falls = {"spindle_angle_rad", "target_angle_rad", "distal_torque_n_m", "motor_command_ratio"}
    assert {name for name, line in lines.items() if line.slope < 0} == falls


@pytest.mark.parametrize("slope", [0.0, float("nan"), float("inf")])
def test_a_line_without_a_slope_is_refused(slope):
    with pytest.raises(CalibrationError, match="do not make a line"):
        LinearCalibration("motor_current_a", "current", slope)


@pytest.mark.parametrize("text", ["", "{}", '{"name": "x", "channels": {"a": {}}}', "[1]"])
def test_what_is_not_a_set_is_refused(text):
    with pytest.raises(CalibrationError, match="not a calibration set"):
        CalibrationSet.from_json(text)


def test_a_file_with_a_wrong_key_is_refused(tmp_path):
    path = tmp_path / "c.toml"
    path.write_text('name = "x"\n[channels.motor_current_a]\ncounts = "current"\nslop = 1.0\n')
    with pytest.raises(CalibrationError, match="slop"):
        load_calibration_set(path)
    with pytest.raises(CalibrationError, match="cannot be read"):
        load_calibration_set(tmp_path / "absent.toml")
