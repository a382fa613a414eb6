"""A model file shown live gives its offline estimate; the three forces of a 3-DOF grasper."""

import json
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from estimation import model_file
from estimation.bank.states import Bank
from estimation.campaign import Campaign
from estimation.effects import effect
from estimation.estimators.bank import BankRecipe
from estimation.fitting import fit
from estimation.model import Estimate, Term, predict
from estimation.recording import MissingChannelError, Recording
from rig.configuration.config import SHIPPED
from rig.diagnosis.subject import subject
from rig.live.block import DeviceStatus
from rig.live.estimator import estimators_of, half_widths
from rig.live.joint_forces import AXES, JOINTS, interval_of_joints, of_joints
from rig.live.replay import replay_blocks
from rig.live.status import ModelStatus
from rig.log.convert import write_recording
from tests.estimation.synthetic import campaign

pytestmark = pytest.mark.integration

SPINDLE = "proximal_torque_n_m"


def recording(seed):
    rng = np.random.default_rng(seed)
    time_s = np.arange(3000) / 1000
    current_a = 0.3 + 0.1 * np.sin((3 + seed) * time_s) + rng.normal(0, 0.002, time_s.size)
    return Recording(
        str(seed), time_s, {"motor_current_a": current_a, SPINDLE: 0.6 * current_a - 0.02}
    )


@pytest.fixture
def motor(tmp_path):
    """The estimator of the declared equation of the motor, and a run that it was fitted on."""
    path, made = tmp_path / "motor.toml", campaign()
    (declared,) = [m for m in model_file.reference_rig() if m.balance == "motor"]
    fitted = fit(declared, made)
    evidence = replace(fitted.evidence, half_width=0.01)
    model_file.write(replace(fitted, evidence=evidence), path)
    run = made.runs[0].recording()
    return lambda: estimators_of(path, run.sample_rate_hz)[0], run


@pytest.fixture
def model_path(tmp_path):
    declared = model_file.read(model_file.shipped()["linear"])
    campaign = Campaign.of([recording(seed) for seed in range(3)])
    path = tmp_path / "linear.toml"
    model_file.write(fit(declared, campaign, bootstrap=0), path)
    return path


def test_replayed_estimates_are_the_causal_prediction(model_path):
    run = recording(7)
    (estimator,) = estimators_of(model_path, run.sample_rate_hz)
    blocks = list(replay_blocks(run, [estimator], speed=None))
    live = np.concatenate([block.estimates[SPINDLE] for block in blocks])
    offline = predict(model_file.read(model_path), run, causal=True)
    settling = run.time_s - run.time_s[0] < 0.04  # twice the period of the filter's 50 Hz
    np.testing.assert_array_equal(np.isnan(live), settling)
    np.testing.assert_allclose(live[~settling], offline[~settling], rtol=1e-9, atol=1e-12)
    assert np.abs(live[1000:] - run[SPINDLE][1000:]).max() < 0.01


def test_a_stream_that_begins_in_motion_shows_no_estimate_until_the_filters_have_settled(motor):
    """The first sample counts as one that had always been there: a step in the acceleration."""
    estimator, run = motor
    speed = np.abs(np.gradient(run["spindle_angle_rad"], run.time_s))
    moving = run.at(np.arange(int(speed.argmax()), len(run)))
    live = estimator().push(moving.columns, moving.time_s)
    whole = estimator().push(run.columns, run.time_s)[-len(moving) :]
    shown = np.isfinite(live)
    assert shown.sum() > len(moving) - 50
    error = np.abs(live - whole)[shown]
    assert error.max() < 0.05 * np.ptp(whole)


def test_a_physical_model_states_no_interval_at_rest(motor):
    """Friction at rest takes any value: an interval of the errors in motion does not hold there."""
    estimator, run = motor[0](), motor[1]
    stood = {name: np.full(4000, values[0]) for name, values in run.columns.items()}
    estimator.push(stood, np.arange(4000) / run.sample_rate_hz)
    assert SPINDLE not in half_widths([estimator])
    begun = 4000 / run.sample_rate_hz + run.time_s - run.time_s[0]
    speed = np.abs(np.gradient(run["spindle_angle_rad"], run.time_s))
    fastest = int(speed.argmax()) + 1
    estimator.push({k: v[:fastest] for k, v in run.columns.items()}, begun[:fastest])
    assert half_widths([estimator])[SPINDLE] == 0.01


def test_a_channel_the_model_lacks_is_named(model_path):
    run = Recording("x", np.arange(100) / 1000, {SPINDLE: np.zeros(100)})
    (estimator,) = estimators_of(model_path, 1000.0)
    with pytest.raises(MissingChannelError, match="motor_current_a"):
        list(replay_blocks(run, [estimator], speed=None))


def test_a_condition_of_the_run_is_a_channel_of_one_value(motor, tmp_path):
    estimator, run = motor
    channels = {"speed": "motor_velocity_rad_s", "condition": "payload_kg"}
    values = {"slope": Estimate(0.05), "width": Estimate(0.5)}
    model, path = estimator().model, tmp_path / "loaded.toml"
    term = Term(effect("friction.condition"), channels=channels, values=values)
    model_file.write(replace(model, terms=(*model.terms, term)), path)
    (stated,) = estimators_of(path, run.sample_rate_hz, {"payload_kg": 2.0})
    (read,) = estimators_of(path, run.sample_rate_hz)
    columns = {**run.columns, "payload_kg": np.full(len(run), 2.0)}
    expected = read.push(columns, run.time_s)
    np.testing.assert_array_equal(stated.push(run.columns, run.time_s), expected)
    plain = estimator().push(run.columns, run.time_s)
    assert np.nanmax(np.abs(plain - expected)) > 0.05


def test_a_state_estimator_runs_live_as_offline(tmp_path):
    runs = list(campaign())
    fitted = BankRecipe(SPINDLE, Bank("motor_current_a"), causal=True).fit(Campaign.of(runs[1:]))
    path = tmp_path / "states.npz"
    fitted.save(path)
    (estimator,) = estimators_of(path, runs[0].sample_rate_hz)
    assert estimator.model is None
    assert estimator.target_channel == SPINDLE
    live, widths = [], []
    for block in replay_blocks(runs[0], [estimator], speed=None):
        live.append(block.estimates[SPINDLE])
        widths.append((sum(map(len, live)) - 1, half_widths([estimator]).get(SPINDLE, np.nan)))
    offline = fitted.estimate(runs[0], causal=True)
    np.testing.assert_allclose(np.concatenate(live), offline.value, atol=1e-9)
    # the display shows the newest sample's own interval, and none while the jaw opens
    newest, shown = np.array(widths).T
    np.testing.assert_allclose(shown, offline.half_width[newest.astype(int)], rtol=1e-6)
    assert 0 < np.isnan(shown).mean() < 1
    assert len(set(shown[np.isfinite(shown)])) > 1


MODEL = SHIPPED / "simulated_grasper.model.toml"


def test_the_grasp_is_of_both_jaws_and_the_pitch_of_the_one_that_touches():
    joints = of_joints(
        {"jaw_1_force_n": np.array([1.0, 0.0]), "jaw_2_force_n": np.array([2.0, 3.0])}
    )
    np.testing.assert_allclose(joints["grasp_force_n"], [1.5, 1.5])
    np.testing.assert_allclose(joints["pitch_force_n"], [2.0, 3.0])
    assert of_joints({"distal_torque_n_m": np.zeros(2)}) == {}
    widths = interval_of_joints({"jaw_1_force_n": 0.1, "jaw_2_force_n": 0.2, "yaw_force_n": 0.3})
    assert [widths[joint] for joint in JOINTS] == pytest.approx([0.15, 0.2, 0.3])


def test_live_shows_three_forces_with_intervals_and_the_age_of_their_fit(said):
    frame = json.loads(said("live -c grasper --pace 0 --duration 6 --json").out.splitlines()[-2])
    channels = frame["channels"]
    assert tuple(channels) == JOINTS
    for channel in channels.values():
        assert channel["half_width95"] > 0
        assert abs(channel["estimate"] - channel["sensor"]) < 2 * channel["half_width95"]
    (status,) = [d for d in frame["devices"] if d["name"] == "estimate"]
    assert " ago" in status["detail"]


def status(days, **estimates):
    made_at = (datetime.now(UTC) - timedelta(days=days)).isoformat()
    models = [
        replace(m, evidence=replace(m.evidence, made_at=made_at))
        for m in model_file.read_all(MODEL)
    ]
    return ModelStatus(models).of({k: np.full(9, v) for k, v in estimates.items()})


def test_an_estimate_beyond_what_was_fitted_is_suspect_and_an_old_fit_stale():
    fitted = DeviceStatus("estimate", "ok", "fitted 12 days ago")
    assert status(12, yaw_force_n=0.5) == fitted
    assert status(200, yaw_force_n=0.5).state == "stale"
    beyond = status(200, jaw_1_force_n=5.0)
    assert beyond.state == "suspect"
    assert re.fullmatch("Jaw 1 force beyond its fit, .* N", beyond.detail)


def test_logs_of_a_grasper_are_diagnosed_axis_by_axis(tmp_path):
    time_s = np.arange(200) / 2000
    motors = ("yaw", "jaw_1", "jaw_2")
    names = [f"{axis}_{channel}" for axis in motors for channel in ("current_a", "angle_rad")]
    columns = {name: np.zeros(200) for name in (*names, *AXES)}
    write_recording(tmp_path / "one.mcap", Recording("one", time_s, columns))
    assert [m.balance for m in subject(tmp_path).models] == ["jaw_1", "jaw_2", "yaw"]
    (one,) = subject(tmp_path, balance="jaw_2").models
    assert one.target == "jaw_2_force_n"
