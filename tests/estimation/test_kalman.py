"""The compiled tracker is filterpy's filter in its steady state, and its lag is as stated."""

import numpy as np
import pytest

from estimation.kalman import steady_filter, tracker
from estimation.live_channels import causal_channels
from tests.estimation.synthetic import run

SPEED = "motor_velocity_rad_s"


def test_it_gives_what_filterpy_gives():
    motion = 0.4 * np.sin(np.linspace(0, 6, 400)) + np.random.default_rng(0).normal(0, 1e-3, 400)
    design, compiled = steady_filter(1000.0), tracker(1000.0)
    design.x = np.array([[motion[0]], [0.0], [0.0]])
    expected = []
    for angle in motion:
        design.predict()
        design.update(np.array([[angle]]))
        expected.append(design.x[:, 0].copy())
    found = compiled.track(motion, compiled.start(motion[0]))
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("rate_hz", [500.0, 1000.0, 2000.0])
def test_an_even_rise_of_the_acceleration_is_followed_with_the_stated_lag(rate_hz):
    found = tracker(rate_hz)
    time_s = np.arange(round(rate_hz)) / rate_hz
    jerk = 300.0
    tracked = found.track(jerk * time_s**3 / 6, found.start(0.0))
    lag_s = time_s[-1] - tracked[-1, 2] / jerk
    assert lag_s == pytest.approx(found.acceleration_lag_s, rel=1e-3)
    assert 0.002 < lag_s < 0.02


def test_tracked_channels_follow_the_motion():
    recording = run("a", 0.4, 0.1, seed=1, seconds=3.0)
    true = np.gradient(recording["motor_angle_rad"], recording.time_s)
    better, worse = (
        np.abs(causal_channels(recording, [SPEED], tracked=tracked)[SPEED] - true)[500:].max()
        for tracked in (True, False)
    )
    assert better < min(0.2, worse)
