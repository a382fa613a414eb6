"""Grasp, pitch and yaw force of a 3-DOF grasper on the live display, as `rig live -c grasper`."""

import json
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from estimation import model_file
from estimation.recording import Recording
from rig.configuration.config import SHIPPED
from rig.diagnosis.subject import subject
from rig.live.block import DeviceStatus
from rig.live.joint_forces import AXES, JOINTS, interval_of_joints, of_joints
from rig.live.status import ModelStatus
from rig.log.convert import write_recording

pytestmark = pytest.mark.integration

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
