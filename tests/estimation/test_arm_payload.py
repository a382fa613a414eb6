"""A mass added to an arm: its torque against Pinocchio's, and the estimate from what is left."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.arm.kinematics import ArmError, built, tip_pose
from estimation.arm.motion import motion_of
from estimation.arm.payload import added_mass, carried_torque, point_mass
from estimation.arm.tables import PSM, DhRow, PointMass, Tool

pin = pytest.importorskip("pinocchio", reason="Pinocchio is not installed (extra arm)")

PERIOD_S = 0.02
SAMPLES = 200
HEIGHT_M = 0.5
LIFTING = [0, 1]


def motion():
    time = np.arange(5 * SAMPLES) * PERIOD_S
    turn = 2 * np.pi / (SAMPLES * PERIOD_S) * time
    waves = [0.6 * np.sin(turn), 0.5 * np.cos(2 * turn), 0.1 + 0.03 * np.sin(turn)]
    return motion_of(np.column_stack([*waves, *np.zeros((3, len(time)))]), PERIOD_S)


def unit(x: float, height: float, z: float) -> np.ndarray:
    return point_mass(PSM, motion(), 2, np.array([x, height, z]))[:, LIFTING]


def test_a_point_mass_weighs_and_resists_as_pinocchio_says():
    model, moved, at = built(PSM).copy(), motion(), np.array([0.02, 0.5, -0.01])
    model.inertias[2] = pin.Inertia(1.0, at, np.zeros((3, 3)))
    found = point_mass(PSM, moved, 2, at)
    data = model.createData()
    for k in range(0, len(moved), 151):
        state = (moved.position[k], moved.velocity[k], moved.acceleration[k])
        np.testing.assert_allclose(found[k], pin.rnea(model, data, *state), atol=1e-9)


def test_a_mass_off_the_axis_is_found_within_its_interval():
    columns = (
        unit(0, HEIGHT_M, 0),
        unit(0.01, HEIGHT_M, 0) - unit(0, HEIGHT_M, 0),
        unit(0, HEIGHT_M, 0.01) - unit(0, HEIGHT_M, 0),
    )
    noise = 0.01 * np.random.default_rng(2).normal(size=columns[0].shape)
    residual = 0.105 * unit(0.02, HEIGHT_M, 0.005) + noise + [0.3, -0.2]
    found = added_mass(residual, columns, unit(0, HEIGHT_M + 0.01, 0), np.ones(2), SAMPLES)
    low, high = found.interval_kg
    assert found.mass_kg == pytest.approx(0.105, rel=0.01)
    assert low < 0.105 < high
    # a taller lever asks for less mass, by between once and twice its share
    assert 0.02 < found.from_lever_kg / found.mass_kg < 0.04


def test_an_arm_carries_its_payload_and_its_tool_as_data():
    moved = motion()
    weight = PointMass("weight", 2, (0.0, 0.5, 0.0), 0.105)
    tool = Tool("a longer driver", DhRow(0.0, -np.pi / 2, 0.02, 0.0), (replace(weight, link=1),))
    arm = PSM.with_payload(weight).with_tool(tool)
    one, other = (point_mass(PSM, moved, k, np.array(weight.point_m)) for k in (2, 1))
    np.testing.assert_allclose(carried_torque(arm, moved), 0.105 * (one + other), atol=1e-12)
    assert not carried_torque(PSM, moved).any()
    moved_tip = tip_pose(arm, np.zeros(6)) @ np.linalg.inv(tip_pose(PSM, np.zeros(6)))
    assert np.linalg.norm(moved_tip[:3, 3]) == pytest.approx(0.01)  # 20 mm in place of 10 mm


def test_a_mass_on_a_link_without_a_mass_of_its_own_is_refused():
    arm = PSM.with_payload(PointMass("weight", 4, (0.0, 0.0, 0.0), 0.1))
    with pytest.raises(ArmError, match="Link 4"):
        carried_torque(arm, motion())
