"""Identification of an arm: base parameters, least squares, channels, effects with memory."""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from estimation.arm.base import base_of
from estimation.arm.consistent import consistent_fit, pseudo_inertia
from estimation.arm.effects import row_count, slip
from estimation.arm.identification import damped_around, fit, thesis_weights
from estimation.arm.kinematics import ArmError
from estimation.arm.motion import Motion, joint_channels, motion_of, periodic_motion
from estimation.arm.recursion import LINK
from estimation.arm.regressor import names, regressor
from estimation.arm.signed import Block, Normal, Products, solve
from estimation.arm.tables import PSM, PSM_CLOSED, Arm
from estimation.arm.wrist import candidates
from estimation.recording import Recording
from rig.arm.simulated import excitation

clarabel_only = pytest.mark.skipif(
    find_spec("clarabel") is None, reason="Clarabel is not installed (extra arm)"
)


def columns_of(seed: int, seconds: float) -> np.ndarray:
    return regressor(PSM, excitation(np.random.default_rng(seed), seconds))


def test_the_thesis_68_parameters_have_48_identifiable_combinations():
    base = base_of(PSM)
    assert len(names(PSM)) == 68
    assert len(base.names) == len(set(base.names)) == 48
    # combinations the thesis prints in table 2.2, with its tool's length of 0.4162 m
    assert {"lz3 + lz4", "ly4 + lz5", "Lzz1 + Lyy2 + Lzz3 + Ia1", "Lxy2 - Lxz3", "Fv56"} <= set(
        base.names
    )


def test_identification_finds_the_base_parameters_behind_the_torques():
    base = base_of(PSM)
    columns = columns_of(3, 30.0)[:, :, base.columns]
    rng = np.random.default_rng(7)
    truth = rng.normal(size=48)
    torque = columns @ truth
    noisy = torque + 0.01 * np.abs(torque).max(axis=0) * rng.normal(size=torque.shape)
    exact = fit(columns, torque, thesis_weights(torque))
    np.testing.assert_allclose(exact.values, truth, atol=1e-7)
    found = fit(columns, noisy, thesis_weights(noisy))
    scaled = (found.values - truth) / found.errors
    assert 0.6 < np.sqrt(np.mean(scaled**2)) < 1.5  # standard errors are honest
    damped = fit(columns, noisy, thesis_weights(noisy), damping=1e-2)
    weighted = columns * thesis_weights(noisy)[:, None]
    length = np.linalg.norm(weighted.reshape(-1, 48), axis=0)
    assert np.linalg.norm(damped.values * length) < np.linalg.norm(found.values * length)


def test_dependent_columns_are_refused_without_damping():
    columns = columns_of(4, 12.0)
    torque = columns @ np.ones(68)
    with pytest.raises(ArmError, match="cannot be identified"):
        fit(columns, torque)
    assert np.isfinite(fit(columns, torque, damping=1e-6).values).all()


def test_joints_are_read_from_a_recordings_channels():
    time = np.arange(5) / 200
    turning = ("joint_1_angle_rad", "joint_1_velocity_rad_s", "joint_1_torque_n_m")
    sliding = ("joint_2_position_m", "joint_2_velocity_m_s", "joint_2_force_n")
    columns = {name: k * time for k, name in enumerate((*turning, *sliding))}
    run = Recording("arm", time, columns)
    both = zip(turning, sliding, strict=True)
    for found, channels in zip(joint_channels(run), both, strict=True):
        np.testing.assert_array_equal(found, np.column_stack([run[name] for name in channels]))
    with pytest.raises(ArmError, match="no arm joints"):
        joint_channels(replace(run, columns={"motor_current_a": time}))


def test_derivatives_of_whole_periods_are_exact_and_noise_above_is_left_out():
    time = np.arange(1000)[:, None] * 0.01
    turn = 2 * np.pi * 0.4
    wave = np.sin(turn * time)
    found = periodic_motion(wave + 0.1 * np.sin(2 * np.pi * 20 * time), 0.01, 5.0)
    np.testing.assert_allclose(found.position, wave, atol=1e-9)
    np.testing.assert_allclose(found.velocity, turn * np.cos(turn * time), atol=1e-9)
    np.testing.assert_allclose(found.acceleration, -(turn**2) * wave, atol=1e-9)
    with pytest.raises(ArmError, match="cannot be differentiated"):
        periodic_motion(wave, 0.01, 80.0)


def test_a_perfect_guess_is_kept_and_a_wrong_one_is_left():
    rng = np.random.default_rng(0)
    columns, truth = rng.normal(size=(50, 2, 3)), np.array([1.0, -2.0, 0.5])
    torque = columns @ truth
    np.testing.assert_allclose(damped_around(columns, torque, truth, 10.0), truth)
    np.testing.assert_allclose(damped_around(columns, torque, np.zeros(3), 1e-3), truth, atol=1e-6)
    with pytest.raises(ArmError, match="not positive"):
        damped_around(columns, torque, truth, 0.0)


def points(seed: int, count: int = 5) -> np.ndarray:
    """Ten parameters of point masses, shape (10,)."""
    rng = np.random.default_rng(seed)
    values = np.zeros(10)
    for mass, (x, y, z) in zip(
        rng.uniform(0.1, 1, count), rng.normal(size=(count, 3)), strict=True
    ):
        inertia = (y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y)
        values += mass * np.array([1, x, y, z, *inertia])
    return values


def real_arm(arm: Arm) -> np.ndarray:
    """Parameters of an arm that could be built."""
    rng = np.random.default_rng(2)
    named = dict(zip(names(arm), rng.uniform(0.05, 0.5, len(names(arm))), strict=True))
    for k, body in enumerate(arm.bodies):
        if body.link == "full":
            at = [f"{name}{body.label}" for name in LINK]
            named |= dict(zip(at, 0.1 * points(k), strict=True))
    return np.array([named[name] for name in names(arm)])


@clarabel_only
@pytest.mark.parametrize("arm", [PSM, PSM_CLOSED], ids=["serial", "closed chain"])
def test_a_real_arm_is_found_and_an_unreal_fit_is_kept_from(arm: Arm):
    base = base_of(arm)
    columns = regressor(arm, excitation(np.random.default_rng(1), 20.0))[:, :, base.columns]
    truth = base.mapping @ real_arm(arm)
    torque = columns @ truth
    weights = thesis_weights(torque)
    found = consistent_fit(arm, columns, torque, weights)
    scale = np.abs(torque).max()
    np.testing.assert_allclose(columns @ base.mapping @ found, torque, atol=2e-3 * scale)

    negative = truth.copy()
    negative[base.names.index("Fv1")] = -1.0
    torque = columns @ negative
    free = fit(columns, torque, weights).values
    held = consistent_fit(arm, columns, torque, weights)
    assert free[base.names.index("Fv1")] == pytest.approx(-1.0, abs=1e-6)
    assert (base.mapping @ held)[base.names.index("Fv1")] > -1e-6
    for body in arm.bodies:
        if body.link == "full":
            link = [held[names(arm).index(f"{name}{body.label}")] for name in LINK]
            assert np.linalg.eigvalsh(pseudo_inertia(np.array(link))).min() > -1e-6


def test_the_counterweights_gravity_pulls_against_the_insertion():
    still = np.zeros((1, 6))
    values = np.zeros(len(names(PSM_CLOSED)))
    values[names(PSM_CLOSED).index("mc")] = 2.0
    values[names(PSM_CLOSED).index("m3")] = 2.0
    motion = Motion(still, still, still, 0.01)
    assert (regressor(PSM_CLOSED, motion) @ values)[0, 2] == pytest.approx(0.0, abs=1e-9)


PERIOD_S = 0.005


def test_an_elastic_slip_element_turns_within_twice_its_threshold():
    there_and_back = np.concatenate([np.linspace(0, 1, 101), np.linspace(0.99, 0.8, 20)])
    stretch = slip(there_and_back[:, None], 0.05)[:, 0]
    assert np.isclose(stretch[5], 1.0)  # slips at its threshold
    assert stretch[100] == 1.0
    assert np.isclose(stretch[105], 0.0)  # relaxed one threshold after the turn
    assert np.isclose(stretch[110], -1.0)  # slips the other way two thresholds after it
    assert np.isclose(stretch[-1], -1.0)


def wave() -> np.ndarray:
    time = np.arange(0, 4, PERIOD_S)[:, None]
    return 0.3 * np.sin((1 + np.arange(7)) * time)


def test_every_candidate_gives_finite_columns_that_differ():
    motion = motion_of(wave(), PERIOD_S)
    tables = [effect.columns(motion) for effect in candidates(PSM)]
    assert len({effect.name for effect in candidates(PSM)}) == len(tables)
    for table in tables:
        assert table.shape[:2] == (len(motion), row_count(PSM))
        assert np.isfinite(table).all()
        assert np.abs(table).max() > 0  # of a track, most knots are not visited


def test_the_wrists_drives_do_the_work_that_its_joints_do():
    motion = motion_of(wave(), PERIOD_S)
    (damping,) = (e for e in candidates(PSM) if e.name == "wrist drive damping")
    coupling = np.array(PSM.wrist_coupling)
    torque = damping.columns(motion)  # N m per N m s of each drive
    drive_speed = np.linalg.solve(coupling, motion.velocity[:, 4:7].T).T
    for drive in range(3):
        power = np.sum(torque[:, :, drive] * motion.velocity[:, :7], axis=1)
        np.testing.assert_allclose(power, drive_speed[:, drive] ** 2, atol=1e-12)


def test_dissipative_parameters_are_never_negative_and_others_are_least_squares():
    rng = np.random.default_rng(3)
    columns, truth = rng.normal(size=(200, 2, 4)), np.array([2.0, -1.0, 0.5, -0.3])
    torque = columns @ truth
    products, weights = Products.of(columns, torque), np.array([1.0, 2.0])
    normal = Normal.of(products, weights)

    def found(signs):
        return solve(normal, [Block("all", np.arange(4), np.array(signs), 0.0, own_length=True)])

    np.testing.assert_allclose(found([False] * 4), truth, atol=1e-10)
    bounded = found([True, False, True, True])
    assert bounded[3] == 0.0
    assert np.all(bounded[[0, 2]] > 0)
    left = torque - columns @ bounded
    expected = np.sqrt(np.mean(left**2, axis=0))
    np.testing.assert_allclose(products.rms(np.arange(4), bounded), expected, rtol=1e-9)
