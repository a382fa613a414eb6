"""Closed chains, derivatives in the frequency domain, damped least squares around a guess."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.arm.identification import damped_around
from estimation.arm.kinematics import ArmError, built, tip_pose
from estimation.arm.motion import periodic_motion
from estimation.arm.regressor import regressor
from estimation.arm.wrench import tip_jacobians
from rig.studies.delsol.hydraulic_arm import HYDRAULIC

pin = pytest.importorskip("pinocchio", reason="Pinocchio is not installed (extra arm)")

PERIOD_S = 0.01


def motion():
    phase = 2 * np.pi * np.arange(400)[:, None] / 400
    return periodic_motion(0.3 * np.sin(phase * (1 + np.arange(5)) + np.arange(5)), PERIOD_S, 5.0)


def test_gravity_torque_is_the_derivative_of_the_energy_through_the_loop():
    mass, pose = 3.0, np.array([[0.2, -0.3, 0.4, 0.1, 0.2]])
    still = replace(motion(), position=pose, velocity=0 * pose, acceleration=0 * pose)
    values = np.zeros(96)
    values[70] = mass  # of the tie bar, at its joint
    torque = (regressor(HYDRAULIC, still) @ values)[0]

    def energy(q):
        model = built(HYDRAULIC)
        data = model.createData()
        pin.forwardKinematics(model, data, HYDRAULIC.closure @ q)
        return mass * 9.80665 * data.oMi[8].translation[2]

    for k in range(5):
        step = 1e-6 * np.eye(5)[k]
        slope = (energy(pose[0] + step) - energy(pose[0] - step)) / 2e-6
        assert torque[k] == pytest.approx(slope, abs=1e-6)


def test_power_at_the_tip_is_the_joints():
    pose = np.array([[0.1, 0.2, -0.3, 0.2, 0.1]])
    jacobian = tip_jacobians(HYDRAULIC, pose)[0]

    def tip(q):
        return tip_pose(HYDRAULIC, q)[:3, 3]

    for k in range(5):
        step = 1e-6 * np.eye(5)[k]
        slope = (tip(pose[0] + step) - tip(pose[0] - step)) / 2e-6
        np.testing.assert_allclose(jacobian[:3, k], slope, atol=1e-8)


def test_derivatives_of_whole_periods_are_exact_and_noise_above_is_left_out():
    time = np.arange(1000)[:, None] * PERIOD_S
    turn = 2 * np.pi * 0.4
    wave = np.sin(turn * time)
    found = periodic_motion(wave + 0.1 * np.sin(2 * np.pi * 20 * time), PERIOD_S, 5.0)
    np.testing.assert_allclose(found.position, wave, atol=1e-9)
    np.testing.assert_allclose(found.velocity, turn * np.cos(turn * time), atol=1e-9)
    np.testing.assert_allclose(found.acceleration, -(turn**2) * wave, atol=1e-9)
    with pytest.raises(ArmError, match="cannot be differentiated"):
        periodic_motion(wave, PERIOD_S, 80.0)


def test_a_perfect_guess_is_kept_and_a_wrong_one_is_left():
    rng = np.random.default_rng(0)
    columns, truth = rng.normal(size=(50, 2, 3)), np.array([1.0, -2.0, 0.5])
    torque = columns @ truth
    np.testing.assert_allclose(damped_around(columns, torque, truth, 10.0), truth)
    np.testing.assert_allclose(damped_around(columns, torque, np.zeros(3), 1e-3), truth, atol=1e-6)
    with pytest.raises(ArmError, match="not positive"):
        damped_around(columns, torque, truth, 0.0)
