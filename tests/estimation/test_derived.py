"""Derived channels: the lowest of a window, samples at rest, closing samples. Error measures."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation import model_file
from estimation.campaign import Campaign
from estimation.closing import closing_samples, processed
from estimation.derived import ALIKE, lowest, since_lowest
from estimation.fitting import fit
from estimation.recording import Flag, Recording, Stretch
from estimation.rest import in_motion
from estimation.scores import ScoreError, rmse, score
from tests.estimation.synthetic import run

STEPS = st.lists(st.integers(-3, 3), min_size=1, max_size=60)


@given(STEPS, st.integers(1, 12))
def test_it_is_the_last_of_the_lowest(steps, window):
    values = np.cumsum(np.array(steps, float))
    for k, place in enumerate(lowest(values, window)):
        part = values[max(0, k - window + 1) : k + 1]
        assert values[place] == part.min()
        assert place == k - np.argmin(part[::-1])
    np.testing.assert_array_equal(
        since_lowest(values, window), values - values[lowest(values, window)]
    )


@given(STEPS, st.integers(1, 12), st.randoms(use_true_random=False))
def test_rounding_does_not_move_it_on_a_drive_at_rest(steps, window, random):
    values = 0.01 * np.cumsum(np.array(steps, float))
    rounded = values + np.array([random.uniform(-1e-13, 1e-13) for _ in steps])
    np.testing.assert_array_equal(lowest(rounded, window, ALIKE), lowest(values, window, ALIKE))


def test_closing_samples_are_fast_enough_and_away_from_the_ends():
    done = processed(run("a", 0.3, 0.1, seed=1), ["motor_current_a"])
    fast = done["spindle_velocity_rad_s"] >= 0.25
    inner = (done.time_s >= 1.0) & (done.time_s < 7.0)
    np.testing.assert_array_equal(closing_samples(done).time_s, done.time_s[fast & inner])


def test_flagged_samples_count_unless_excluded():
    recording = run("a", 0.3, 0.1, seed=1).with_stretch(Stretch(3, 5, Flag.SUSPECT, "test"))
    done = processed(recording, ["motor_current_a"])
    assert len(closing_samples(done, keep_flagged=False)) < len(closing_samples(done))


def test_rest_is_where_the_motor_stands_and_a_little_around_it():
    speed = np.concatenate([np.full(500, 10.0), np.zeros(500), np.full(500, -10.0)])
    moving = in_motion(speed, np.ones(1500, bool), 1000.0, 0.7)
    assert moving[:450].all()
    assert moving[1050:].all()
    assert not moving[490:1010].any()


def test_torque_that_friction_holds_at_rest_does_not_move_the_torque_constant():
    """A motor pushes on a joint that sticks: the sensor sees the push less what friction holds."""
    time_s = np.arange(8000) * 1e-3
    motor_rad = 20.0 * np.clip(np.sin(2 * np.pi * 0.5 * time_s), -0.6, 0.6)
    velocity = np.gradient(motor_rad, time_s)
    current_a = 0.2 + 0.1 * np.sin(2 * np.pi * 0.31 * time_s)
    friction = 0.03 * np.tanh(velocity / 0.5)
    held = np.where(np.abs(velocity) < 1e-6, 0.03 * np.sign(current_a - 0.2), friction)
    columns = {"motor_angle_rad": motor_rad, "motor_current_a": current_a}
    columns["proximal_torque_n_m"] = 0.9 * current_a - held
    campaign = Campaign.of([Recording("a", time_s, columns)])
    fitted = fit(model_file.read(Path("motor")), campaign, bootstrap=0)
    gain = next(t for t in fitted.terms if t.effect.id == "motor.torque_constant").values["gain"]
    assert gain.value == pytest.approx(0.9, rel=0.03)


def test_scores_of_a_small_example_and_of_a_constant_estimate():
    found = score([1.0, 2.0, 3.0, 5.0], [1.0, 2.0, 4.0, 4.0])
    assert (found.samples, found.mae, found.p95) == (4, 0.5, 1.0)
    assert found.rmse == rmse([1.0, 3.0], [0.0, 3.0]) == pytest.approx(np.sqrt(0.5))
    assert found.pearson_r == pytest.approx(np.corrcoef([1, 2, 3, 5], [1, 2, 4, 4])[0, 1])
    constant = score([2.0, 2.0], [1.0, 3.0])
    assert np.isnan([constant.pearson_r, constant.spearman_rho]).all()
    assert constant.mae == 1.0


def test_rank_correlation_sees_order_only():
    x = np.linspace(0, 3, 50)
    found = score(np.exp(x), x)
    assert found.spearman_rho == pytest.approx(1.0)
    assert found.pearson_r < 0.95


@pytest.mark.parametrize(("estimate", "truth"), [([1.0], [1.0, 2.0]), ([], []), ([np.nan], [1.0])])
def test_what_cannot_be_scored_is_refused(estimate, truth):
    with pytest.raises(ScoreError):
        score(estimate, truth)
