"""Sensor zeros and drift verdicts."""

import numpy as np
import pytest

from calibration.errors import CalibrationError
from calibration.linear import CalibrationSet, LinearCalibration
from calibration.zero import drift_verdicts, measure_zeros

COUNTS = np.dtype([("distal", "<i2"), ("motor", "<i4")])
SET = CalibrationSet(
    "test",
    {
        "distal_torque_n_m": LinearCalibration("distal_torque_n_m", "distal", -1e-3, tared=True),
        "motor_angle_rad": LinearCalibration("motor_angle_rad", "motor", 1e-3),
    },
)


def rest(mean: float, count: int = 500) -> np.ndarray:
    counts = np.zeros(count, COUNTS)
    counts["distal"] = np.round(mean + np.random.default_rng(0).normal(0, 2, count))
    return counts


def test_only_tared_channels_have_a_zero():
    zeros = measure_zeros(rest(40.0), SET)
    assert set(zeros) == {"distal_torque_n_m"}
    zero = zeros["distal_torque_n_m"]
    assert zero.mean_counts == pytest.approx(40.0, abs=0.5)
    assert zero.std_counts == pytest.approx(2.0, rel=0.2)


def test_too_few_readings_are_no_zero():
    with pytest.raises(CalibrationError, match="too few"):
        measure_zeros(rest(0.0, 99), SET)


@pytest.mark.parametrize(("after", "passes"), [(41.0, True), (60.0, False), (20.0, False)])
def test_the_verdict_compares_the_change_with_the_limit(after, passes):
    before, last = measure_zeros(rest(40.0), SET), measure_zeros(rest(after), SET)
    (verdict,) = drift_verdicts(before, last, SET, {"distal_torque_n_m": 5e-3})
    assert verdict.passes is passes
    assert verdict.after - verdict.before == pytest.approx(-(after - 40.0) * 1e-3, abs=1e-9)
    assert verdict.unit == "N m"


def test_a_limit_on_a_channel_without_a_zero_is_refused():
    zeros = measure_zeros(rest(0.0), SET)
    with pytest.raises(CalibrationError, match="has a drift limit but no zero"):
        drift_verdicts(zeros, zeros, SET, {"motor_angle_rad": 1.0})


def test_a_sensor_that_never_changes_is_no_sensor_at_rest():
    """A dead input reads one number for ever; its mean would pass for a zero."""
    counts = rest(0.0)
    counts["distal"] = 40
    with pytest.raises(CalibrationError, match="500 times the same"):
        measure_zeros(counts, SET)
