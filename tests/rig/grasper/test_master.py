"""The master's potentiometers: counts to joints to motors, and what they refuse."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.cli.main import main
from rig.grasper.coupling import GrasperError, JointLimitError
from rig.grasper.master import Pot
from rig.live.grasper import master, master_session


@given(st.tuples(*[st.floats(-0.9, 0.9)] * 3))
def test_motors_reach_what_the_master_shows_to_a_count(joints):
    chief = master()
    reached = chief.grasper.joint_position(chief.motor_rad(chief.counts(joints)))
    assert np.abs(reached - joints).max() <= Pot().rad_per_count / 2 + 1e-12


def test_a_yaw_of_the_master_moves_the_yaw_motor_only():
    chief = master()
    motors = chief.motor_rad(chief.counts([0.5, 0.0, 0.0]))
    assert motors[0] == pytest.approx(33 * 0.5, abs=0.05)  # yaw is twice the carrier's angle
    assert motors[1:] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("counts", [[0, 2048, 2048], [2048, 4095, 2048], [2048, 2048, np.nan]])
def test_a_potentiometer_at_its_rail_commands_nothing(counts):
    with pytest.raises(GrasperError, match="rail"):
        master().motor_rad(counts)


def test_a_joint_beyond_its_limits_is_refused():
    with pytest.raises(JointLimitError, match="yaw"):
        master().motor_rad([4000, 2048, 2048])


def test_three_forces_are_estimated_from_current_beside_their_sensors():
    session = master_session()
    for k, dof in enumerate(("grasp", "pitch", "yaw")):
        force, estimate = session[f"{dof}_force_n"], session[f"estimated_{dof}_force_n"]
        assert force.max() == pytest.approx(1.5, abs=0.1)
        assert int(np.argmax(force) // (len(force) / 3)) == k
        assert abs(estimate[np.argmax(force)] - 1.5) < 0.8


def test_the_display_shows_all_three(capsys):
    words = ["live", "--grasper", "--pace", "0", "--duration", "6", "--json"]
    assert main(words) == 0
    frames = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    channels = frames[-2]["channels"]
    assert list(channels) == ["grasp_force_n", "pitch_force_n", "yaw_force_n"]
    assert all(channel["estimate"] is not None for channel in channels.values())
