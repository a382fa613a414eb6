"""An arm against Pinocchio and NumPy: tip, Jacobians, regressor, payloads, wrench, excitation."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from estimation.arm.excitation import (
    ACCELERATION_PER_SPEED,
    FUNDAMENTAL_HZ,
    by_active_set,
    condition,
    fitted,
    improved,
    numbers_of,
    start,
)
from estimation.arm.kinematics import ArmError, built, tip_pose
from estimation.arm.motion import Motion, motion_of
from estimation.arm.payload import added_mass, carried_torque, point_mass
from estimation.arm.regressor import names, regressor
from estimation.arm.tables import PSM, Arm, DhRow, PointMass, Tool
from estimation.arm.wrench import (
    LiveWrench,
    body_jacobians,
    by_pseudo_inverse,
    most_likely,
    spatial_jacobians,
    tip_jacobians,
)
from rig.cli.study import study_app
from rig.studies.delsol.hydraulic_arm import HYDRAULIC

pin = pytest.importorskip("pinocchio", reason="Pinocchio is not installed (extra arm)")

within_limits = st.tuples(*(st.floats(j.lower, j.upper) for j in PSM.joints)).map(np.array)


def transform(row: DhRow, theta_rad: float, d_m: float) -> np.ndarray:
    """Craig's modified DH matrix, element by element."""
    ca, sa = np.cos(row.alpha_rad), np.sin(row.alpha_rad)
    ct, st_ = np.cos(theta_rad), np.sin(theta_rad)
    return np.array(
        [
            [ct, -st_, 0, row.a_m],
            [st_ * ca, ct * ca, -sa, -sa * d_m],
            [st_ * sa, ct * sa, ca, ca * d_m],
            [0, 0, 0, 1],
        ]
    )


def joint_frames(q: np.ndarray) -> list[np.ndarray]:
    frames, pose = [], np.eye(4)
    for joint, value in zip(PSM.joints, q, strict=True):
        turn, shift = (value, 0.0) if joint.kind == "revolute" else (0.0, value)
        row = joint.row
        pose = pose @ transform(row, row.theta_rad + turn, row.d_m + shift)
        frames.append(pose)
    return [*frames, pose @ transform(PSM.tip, PSM.tip.theta_rad, PSM.tip.d_m)]


@given(within_limits)
def test_the_tip_is_where_the_tables_product_puts_it(q):
    np.testing.assert_allclose(tip_pose(PSM, q), joint_frames(q)[-1], atol=1e-12)


def slopes(function, pose: np.ndarray) -> list:
    """Return the derivatives of a function by each position."""
    return [(function(pose + h) - function(pose - h)) / 2e-6 for h in 1e-6 * np.eye(len(pose))]


@given(within_limits)
def test_the_jacobians_are_the_derivative_of_the_tips_pose(q):
    (spatial,), (body,) = spatial_jacobians(PSM, q[None]), body_jacobians(PSM, q[None])
    back = np.linalg.inv(joint_frames(q)[-1])
    for k, rate in enumerate(slopes(lambda at: joint_frames(at)[-1], q)):
        for jacobian, twist in ((spatial, rate @ back), (body, back @ rate)):
            linear, angular = twist[:3, 3], (twist[2, 1], twist[0, 2], twist[1, 0])
            np.testing.assert_allclose(jacobian[:, k], [*linear, *angular], atol=1e-8)


def test_gravity_torque_is_the_derivative_of_the_energy_through_the_loop():
    mass, pose = 3.0, np.array([0.2, -0.3, 0.4, 0.1, 0.2])
    still = Motion(pose[None], 0 * pose[None], 0 * pose[None], 0.01)
    values = np.zeros(96)
    values[70] = mass  # of the tie bar, at its joint

    def energy(q):
        model = built(HYDRAULIC)
        data = model.createData()
        pin.forwardKinematics(model, data, HYDRAULIC.closure @ q)
        return mass * 9.80665 * data.oMi[8].translation[2]

    (torque,) = regressor(HYDRAULIC, still) @ values
    np.testing.assert_allclose(torque, slopes(energy, pose), atol=1e-6)


def test_power_at_the_tip_is_the_joints():
    pose = np.array([0.1, 0.2, -0.3, 0.2, 0.1])
    (jacobian,) = tip_jacobians(HYDRAULIC, pose[None])
    moved = slopes(lambda q: tip_pose(HYDRAULIC, q)[:3, 3], pose)
    np.testing.assert_allclose(jacobian[:3].T, moved, atol=1e-8)


FULL = replace(PSM, joints=tuple(replace(joint, link="full") for joint in PSM.joints))
TILTED = replace(FULL, gravity_m_s2=(3.0, -2.0, -9.0))

seeds = st.integers(0, 2**32 - 1)


def random_motion(seed: int, joints: int) -> Motion:
    rng = np.random.default_rng(seed)
    return Motion(*rng.uniform(-3, 3, (3, 4, joints)), period_s=0.01)


@pytest.mark.parametrize("arm", [FULL, TILTED], ids=["upright", "tilted"])
@given(seed=seeds)
def test_a_serial_arms_columns_are_pinocchios(arm: Arm, seed: int):
    motion, model = random_motion(seed, 6), built(arm)
    data = model.createData()
    for k, columns in enumerate(regressor(arm, motion)[:, :, :60]):
        state = motion.position[k], motion.velocity[k], motion.acceleration[k]
        theirs = pin.computeJointTorqueRegressor(model, data, *state)
        np.testing.assert_allclose(columns, theirs, atol=1e-10)


@given(seed=seeds)
def test_a_trees_columns_are_pinocchios_through_the_loop_closure(seed: int):
    motion, model = random_motion(seed, 5), built(HYDRAULIC)
    data, closure = model.createData(), HYDRAULIC.closure
    for k, columns in enumerate(regressor(HYDRAULIC, motion)[:, :, :80]):
        state = (closure @ x[k] for x in (motion.position, motion.velocity, motion.acceleration))
        theirs = closure.T @ pin.computeJointTorqueRegressor(model, data, *state)
        np.testing.assert_allclose(columns, theirs, atol=1e-9)


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


WRENCH = np.array([3.0, -2.0, 1.0, 0.2, 0.1, -0.1])
ERROR = np.array([0.02, 0.02, 0.1, 0.001, 0.002, 0.002])


def poses(n: int = 200) -> np.ndarray:
    rng = np.random.default_rng(4)
    lower, upper = (np.array([getattr(j, k) for j in PSM.joints]) for k in ("lower", "upper"))
    return rng.uniform(lower, upper, (n, 6))


def test_both_ways_give_back_the_wrench_that_was_applied():
    jacobians = spatial_jacobians(PSM, poses())
    torque = np.einsum("nij,i->nj", jacobians, WRENCH)
    told = np.linalg.cond(jacobians) < 1e3
    np.testing.assert_allclose(
        by_pseudo_inverse(jacobians, torque)[told], WRENCH + np.zeros((told.sum(), 6)), atol=1e-6
    )
    found = most_likely(jacobians, torque, ERROR)
    spread = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    assert np.all(np.abs(found.value - WRENCH) < 3 * spread)


def test_the_covariance_is_that_of_the_errors():
    rng = np.random.default_rng(6)
    jacobians = np.repeat(spatial_jacobians(PSM, poses(1)), 4000, axis=0)
    noise = ERROR * rng.normal(size=(4000, 6))
    found = most_likely(jacobians, np.einsum("nij,i->nj", jacobians, WRENCH) + noise, ERROR)
    off = found.value - found.value.mean(axis=0)
    distance = np.einsum("ni,nij,nj->n", off, np.linalg.inv(found.covariance), off)
    # likely wrenches take a little of the scatter away
    assert 4.5 < distance.mean() < 6.3


def test_a_singular_pose_gives_a_finite_wrench_and_a_wide_covariance():
    singular = np.array([[0.0, 0.0, 0.02, 0.0, 0.0, 0.0]])  # the wrist in the remote centre
    jacobians = spatial_jacobians(PSM, singular)
    assert np.linalg.cond(jacobians[0]) > 1e6
    found = most_likely(jacobians, ERROR[None], ERROR)
    assert np.abs(found.value).max() < 40
    widest = np.sqrt(np.linalg.eigvalsh(found.covariance[0])[-1])
    ordinary = most_likely(spatial_jacobians(PSM, np.full((1, 6), 0.1)), ERROR[None], ERROR)
    assert widest > 3 * np.sqrt(np.linalg.eigvalsh(ordinary.covariance[0])[-1])


def test_the_live_wrench_is_the_one_applied_half_a_window_ago():
    rng = np.random.default_rng(0)
    values, period = 0.1 * rng.normal(size=68), 1e-3
    # friction's sign does not commute with the window
    values[[name.startswith("Fs") for name in names(PSM)]] = 0
    time = np.arange(0, 1.5, period)[:, None]
    turn = 1 + np.arange(6)
    size = np.array([0.3, 0.3, 0.03, 0.5, 0.5, 0.5])
    middle = np.array([0, 0, 0.1, 0, 0, 0])
    wave = (size * np.sin(turn * time), size * turn * np.cos(turn * time))
    motion = Motion(middle + wave[0], wave[1], -(turn**2) * wave[0], period)
    pushed = WRENCH * np.sin(2 * time)
    jacobians = spatial_jacobians(PSM, motion.position)
    torque = regressor(PSM, motion) @ values + np.einsum("nij,ni->nj", jacobians, pushed)
    live = LiveWrench(PSM, values, ERROR, period)
    found = [live.step(q, t) for q, t in zip(motion.position, torque, strict=True)]
    assert found[59] is None
    ready = np.array(found[60:])
    np.testing.assert_allclose(ready, pushed[30 : 30 + len(ready)], atol=0.12)


def test_wrong_numbers_are_named():
    with pytest.raises(ArmError, match="68 parameters"):
        LiveWrench(PSM, np.zeros(3), ERROR, 1e-3)
    with pytest.raises(ArmError, match="positive error"):
        most_likely(spatial_jacobians(PSM, poses(1)), ERROR[None], np.zeros(6))
    with pytest.raises(ArmError, match="finite"):
        spatial_jacobians(PSM, np.full((1, 6), np.nan))


@settings(max_examples=20)
@given(st.integers(0, 10_000), st.floats(0, 1))
def test_limits_hold_between_the_sampled_instants(seed, phase):
    time = (np.arange(7919) + phase) / (7919 * FUNDAMENTAL_HZ)
    motion = fitted(PSM, start(PSM, seed)).motion(time)
    for k, joint in enumerate(PSM.joints):
        assert joint.lower <= motion.position[:, k].min()
        assert motion.position[:, k].max() <= joint.upper
        assert np.abs(motion.velocity[:, k]).max() <= joint.speed
        assert np.abs(motion.acceleration[:, k]).max() <= ACCELERATION_PER_SPEED * joint.speed


def test_the_command_writes_a_table_and_a_trajectory_within_limits(tmp_path):
    out, path = tmp_path / "excitation.md", tmp_path / "trajectory.csv"
    words = ["excitation", "--starts", "1", "--evaluations", "150", "--out", str(out)]
    ran = CliRunner().invoke(study_app, [*words, "--trajectory", str(path), "--json"])
    assert ran.exit_code == 0, ran.output
    (row,) = json.loads(ran.stdout)["starts"]
    assert row["ours"]["condition"] < row["condition"]
    assert row["ours"]["limits_share"] <= 1 + 1e-9
    assert "active set: condition" in out.read_text()
    values = np.loadtxt(path, delimiter=",", skiprows=1)
    assert values.shape == (2000, 7)
    for k, joint in enumerate(PSM.joints):
        assert joint.lower <= values[:, k + 1].min() < values[:, k + 1].max() <= joint.upper


@pytest.mark.long
def test_a_search_is_never_worse_than_its_start():
    """From this start the last trial of a search is eight times worse than the start."""
    first = by_active_set(PSM, fitted(PSM, start(PSM, 1)), 3000)
    scaled = fitted(PSM, numbers_of(PSM, first))
    assert condition(PSM, improved(PSM, first, 3000)) <= condition(PSM, scaled)
