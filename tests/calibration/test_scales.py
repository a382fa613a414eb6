"""Scales of torque and current sensors in recordings of a rig whose scales are known."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.quality import BadDataError
from calibration.record import CalibrationRecord, Fit
from calibration.scales import current_scale, torque_scale
from estimation.recording import Recording

RATIO, CONSTANT = 0.9, 0.85
RNG = np.random.default_rng(3)


def run(k, capstan=0.0, friction=0.0):
    """Ten seconds of a sine against a load: a cable with friction, and a drive with its own."""
    time_s = np.arange(10_000) / 1000
    w = 2 * np.pi * 0.3
    angle, speed = 0.6 * np.sin(w * time_s), 0.6 * w * np.cos(w * time_s)
    load = 0.02 * (k + 1) * (1 + 0.3 * np.sin(0.7 * time_s))
    way = np.tanh(speed / 0.02)
    spindle = RATIO * load * np.exp(capstan * way) + friction * way
    current = (spindle + 0.03 * way + 1e-3 * speed) / CONSTANT
    noise = 1e-4 * RNG.normal(size=(3, time_s.size))
    columns = {
        "spindle_angle_rad": angle,
        "jaw_angle_rad": RATIO * angle,
        "proximal_torque_n_m": spindle + noise[0],
        "distal_torque_n_m": load + noise[1],
        "motor_current_a": current + noise[2],
        "motor_command_ratio": current / 2.0,
    }
    return Recording(f"{k:03}", time_s, columns)


def runs(**kind):
    return [run(k, **kind) for k in range(6)]


def with_gain(recordings, channel, gain):
    return [
        replace(r, columns={**r.columns, channel: gain * r.columns[channel]}) for r in recordings
    ]


def record(constant):
    names = ("torque_constant_n_m_a", "friction_n_m", "damping_n_m_s_rad", "offset_n_m")
    covariance = tuple(tuple(1e-8 if i == j else 0.0 for j in range(4)) for i in range(4))
    fit = Fit("current", dict(zip(names, (constant, 0, 0, 0), strict=True)), covariance, 1e-3, 900)
    return CalibrationRecord(
        "current", "spindle_torque_n_m", "motor_current_a", "2026-01-02T03:04:05+00:00", "A", fit
    )


def test_without_friction_that_grows_with_load_the_torque_sensors_agree_closely():
    found = torque_scale(runs(friction=0.02))
    assert not found.is_wrong
    assert found.low < 1.0 < found.high
    assert found.high - found.low < 0.05


@pytest.mark.parametrize("gain", [0.8, 1.25])
def test_a_torque_sensor_with_a_wrong_scale_is_found(gain):
    found = torque_scale(with_gain(runs(friction=0.02), "proximal_torque_n_m", gain))
    assert found.is_wrong
    assert found.low < gain < found.high


def test_friction_that_grows_with_load_widens_the_interval_and_raises_no_alarm():
    found = torque_scale(runs(capstan=0.3))
    assert not found.is_wrong
    assert found.low == pytest.approx(np.exp(-0.3), rel=0.1)
    assert found.high == pytest.approx(np.exp(0.3), rel=0.1)


def test_current_and_torque_are_held_against_the_calibrated_constant():
    found = current_scale(runs(capstan=0.3), None)
    assert found.low < CONSTANT < found.high
    assert not found.is_wrong  # nothing to compare with
    assert not current_scale(runs(), record(CONSTANT)).is_wrong
    assert current_scale(with_gain(runs(), "motor_current_a", 1.2), record(CONSTANT)).is_wrong


def test_recordings_that_cannot_be_compared_are_refused_with_the_reason():
    with pytest.raises(BadDataError, match="runs"):
        torque_scale(runs()[:2])
    still = [replace(r, columns={**r.columns, "distal_torque_n_m": 0 * r.time_s}) for r in runs()]
    with pytest.raises(BadDataError):
        torque_scale(still)
