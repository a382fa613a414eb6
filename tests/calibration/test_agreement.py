"""Sensors held against each other in recordings that exist: encoders, torques, the current."""

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from calibration.agreement import NoPairError, agreements
from calibration.quality import BadDataError
from calibration.record import CalibrationRecord, Fit
from calibration.scales import current_scale, torque_scale
from estimation.recording import Recording
from tests.estimation.synthetic import campaign

RATIO, CONSTANT = 0.9, 0.85


def runs(scale: float = 1.0, offset_rad: float = 0.0, twist_rad_n_m: float = 0.0):
    """Nine runs whose spindle encoder has a scale and an offset of its own."""
    random, made = np.random.default_rng(0), []
    for run in campaign():
        twist = twist_rad_n_m * run["proximal_torque_n_m"] + 1e-4 * random.normal(size=len(run))
        angle = scale * run["spindle_angle_rad"] + offset_rad - twist
        made.append(run.with_columns(spindle_angle_rad=angle))
    return made


@pytest.mark.parametrize(("scale", "offset_rad"), [(1.0, 0.0), (1.0, radians(17)), (1.03, 0.0)])
def test_a_scale_and_a_zero_that_are_off_are_found_with_their_size(scale, offset_rad):
    (found,) = agreements(runs(scale, offset_rad, twist_rad_n_m=0.2 if scale == 1.0 else 0.0))
    assert found.runs == 9
    assert found.scale == pytest.approx(scale, abs=1e-3)
    assert found.offset_rad == pytest.approx(offset_rad, rel=0.01, abs=1e-3)
    assert found.scale_is_wrong == (scale != 1.0)
    assert found.offset_is_wrong == (offset_rad != 0.0)


def test_flagged_samples_are_not_counted():
    spoilt = []
    for run in runs():
        flags = np.zeros(len(run), np.uint8)
        flags[:2000] = 1
        angle = run["spindle_angle_rad"] + np.where(flags, 1.0, 0.0)
        spoilt.append(replace(run.with_columns(spindle_angle_rad=angle), flags=flags))
    (found,) = agreements(spoilt)
    assert not found.offset_is_wrong


def test_without_two_encoders_there_is_nothing_to_compare():
    alone = [replace(run, columns={"motor_angle_rad": run["motor_angle_rad"]}) for run in runs()]
    for few in (alone, runs()[:2]):
        with pytest.raises(NoPairError, match="encoders"):
            agreements(few)


def loaded(k, channel="motor_current_a", gain=1.0, capstan=0.0, friction=0.0):
    """Ten seconds of a sine against a load: a cable with friction, and a drive with its own."""
    time_s = np.arange(10_000) / 1000
    w = 2 * np.pi * 0.3
    angle, speed = 0.6 * np.sin(w * time_s), 0.6 * w * np.cos(w * time_s)
    load = 0.02 * (k + 1) * (1 + 0.3 * np.sin(0.7 * time_s))
    way = np.tanh(speed / 0.02)
    spindle = RATIO * load * np.exp(capstan * way) + friction * way
    current = (spindle + 0.03 * way + 1e-3 * speed) / CONSTANT
    noise = 1e-4 * np.random.default_rng(k).normal(size=(3, time_s.size))
    columns = {
        "spindle_angle_rad": angle,
        "jaw_angle_rad": RATIO * angle,
        "proximal_torque_n_m": spindle + noise[0],
        "distal_torque_n_m": load + noise[1],
        "motor_current_a": current + noise[2],
        "motor_command_ratio": current / 2.0,
    }
    columns[channel] = gain * columns[channel]
    return Recording(f"{k:03}", time_s, columns)


def loaded_runs(*kind, **more):
    return [loaded(k, *kind, **more) for k in range(6)]


def record(constant):
    fit = Fit("current", {"torque_constant_n_m_a": constant}, 1e-8 * np.eye(1), 1e-3, 900)
    names = ("current", "spindle_torque_n_m", "motor_current_a")
    return CalibrationRecord(*names, "2026-01-02T03:04:05+00:00", "A", fit)


@pytest.mark.parametrize("gain", [1.0, 0.8, 1.25])
def test_a_torque_sensor_with_a_wrong_scale_is_found(gain):
    found = torque_scale(loaded_runs("proximal_torque_n_m", gain, friction=0.02))
    assert found.is_wrong == (gain != 1.0)
    assert found.low < gain < found.high
    assert found.high - found.low < 0.05 * gain


def test_friction_that_grows_with_load_widens_the_interval_and_raises_no_alarm():
    found = torque_scale(loaded_runs(capstan=0.3))
    assert not found.is_wrong
    assert found.low == pytest.approx(np.exp(-0.3), rel=0.1)
    assert found.high == pytest.approx(np.exp(0.3), rel=0.1)


def test_current_and_torque_are_held_against_the_calibrated_constant():
    found = current_scale(loaded_runs(capstan=0.3), None)
    assert found.low < CONSTANT < found.high
    assert not found.is_wrong  # nothing to compare with
    assert not current_scale(loaded_runs(), record(CONSTANT)).is_wrong
    assert current_scale(loaded_runs(gain=1.2), record(CONSTANT)).is_wrong


def test_recordings_that_cannot_be_compared_are_refused_with_the_reason():
    with pytest.raises(BadDataError, match="runs"):
        torque_scale(loaded_runs()[:2])
    with pytest.raises(BadDataError):
        torque_scale(loaded_runs("distal_torque_n_m", 0.0))
