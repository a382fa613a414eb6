"""`rig grip`: the estimate alone is held, the sensor agrees, and every way out is safe."""

import json

import numpy as np
import pytest

from estimation.estimator import load
from rig.bench.session import Session
from rig.errors import SafetyTripError
from rig.live.estimator import LiveEstimator
from rig.live.grip import hold_grip
from tests.rig.simulated import is_armed, simulated, transport

pytestmark = pytest.mark.integration


def test_a_torque_is_held_by_the_estimate_and_the_sensor_agrees(answered):
    said = answered("grip --torque 0.06")
    assert said["estimate_n_m"] == pytest.approx(0.06, abs=0.003)
    assert abs(said["sensor_n_m"] - 0.06) < said["half_width95_n_m"]
    assert [p["time_s"] for p in said["periods"]] == sorted(p["time_s"] for p in said["periods"])


def test_a_torque_the_load_cannot_give_is_reported(said):
    assert "not reached" in said("grip --torque 0.3 --duration 12", code=1).out


class Constant:
    target_channel = "distal_torque_n_m"
    inside = None

    def __init__(self, torque_n_m):
        self.torque_n_m = torque_n_m

    def push(self, columns, time_s):
        return np.full(time_s.size, self.torque_n_m)


def test_an_estimate_beyond_the_limit_disarms_the_rig():
    config = simulated()
    link = transport(config)
    with pytest.raises(SafetyTripError, match="estimate"), Session(config, link) as session:
        list(hold_grip(session, Constant(5.0), 0.05, 8.0))
    assert not is_armed(link.board)


def test_the_load_stays_within_its_share_and_is_off_at_the_end():
    config = simulated()
    with Session(config, transport(config)) as session:
        held = list(hold_grip(session, Constant(0.0), 0.3, 12.0))
        last = next(session.watch())
        session.safe()
    assert max(period.load_a for period in held) == pytest.approx(0.8 * 1.2)
    assert last.columns["load_command_a"][-1] == 0.0


def test_a_torque_there_was_no_time_for_is_not_called_held(said):
    out, err = said("grip --torque 0.06 --duration 8 --json", code=1)
    assert not json.loads(out)["is_reached"]
    assert "longer --duration" in err


class ValidOnClosing(LiveEstimator):
    """The shipped model, which on opening gives a number far off, and knows that it does."""

    def push(self, columns, time_s):
        estimate = super().push(columns, time_s)
        self._closes = np.gradient(columns["spindle_angle_rad"]) > 2e-4
        return np.where(self._closes, estimate, -0.2)

    @property
    def inside(self):
        return self._closes


def test_the_load_follows_samples_within_the_estimators_range_alone():
    config = simulated()
    estimator = ValidOnClosing(load(config.model_path), 1000.0)
    with Session(config, transport(config)) as session:
        held = list(hold_grip(session, estimator, 0.05, 24.0))
    assert held[-1].estimate_n_m == pytest.approx(0.05, abs=0.005)


def test_an_estimator_that_is_never_within_its_range_moves_no_load(said, monkeypatch):
    never = property(lambda self: np.zeros(len(self.last), bool))
    monkeypatch.setattr(LiveEstimator, "inside", never)
    push = LiveEstimator.push
    monkeypatch.setattr(
        LiveEstimator, "push", lambda self, c, t: setattr(self, "last", t) or push(self, c, t)
    )
    assert "never within" in said("grip --torque 0.05 --duration 8", code=1).out
