"""Encoders against each other in recordings that exist."""

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from calibration.agreement import NoPairError, agreements
from tests.estimation.synthetic import campaign


def runs(scale: float = 1.0, offset_rad: float = 0.0, twist_rad_n_m: float = 0.0):
    """Nine runs whose spindle encoder has a scale and an offset of its own."""
    random = np.random.default_rng(0)
    made = []
    for handle in campaign().runs:
        run = handle.recording()
        noise = 1e-4 * random.normal(size=len(run))
        angle = scale * run["spindle_angle_rad"] + offset_rad + noise
        angle = angle - twist_rad_n_m * run["proximal_torque_n_m"]
        made.append(replace(run, columns={**run.columns, "spindle_angle_rad": angle}))
    return made


def test_encoders_that_agree():
    (found,) = agreements(runs(twist_rad_n_m=0.2))
    assert found.runs == 9
    assert found.scale == pytest.approx(1.0, abs=1e-3)
    assert found.offset_rad == pytest.approx(0.0, abs=1e-3)
    assert not found.scale_is_wrong
    assert not found.offset_is_wrong


def test_a_zero_that_is_off_is_found_with_its_size():
    (found,) = agreements(runs(offset_rad=radians(17), twist_rad_n_m=0.2))
    assert found.offset_is_wrong
    assert found.offset_rad == pytest.approx(radians(17), rel=0.01)
    assert not found.scale_is_wrong


def test_a_wrong_ratio_is_found_with_its_size():
    (found,) = agreements(runs(scale=1.03))
    assert found.scale_is_wrong
    assert found.scale == pytest.approx(1.03, rel=1e-3)
    assert not found.offset_is_wrong


def test_flagged_samples_are_not_counted():
    spoilt = []
    for run in runs():
        flags = np.zeros(len(run), np.uint8)
        flags[:2000] = 1
        angle = run["spindle_angle_rad"] + np.where(flags, 1.0, 0.0)
        columns = {**run.columns, "spindle_angle_rad": angle}
        spoilt.append(replace(run, columns=columns, flags=flags))
    (found,) = agreements(spoilt)
    assert not found.offset_is_wrong


def test_without_two_encoders_there_is_nothing_to_compare():
    alone = [replace(run, columns={"motor_angle_rad": run["motor_angle_rad"]}) for run in runs()]
    with pytest.raises(NoPairError, match="encoders"):
        agreements(alone)
    with pytest.raises(NoPairError):
        agreements(runs()[:2])
