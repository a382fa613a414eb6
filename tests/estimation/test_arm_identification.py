"""Regressor, base parameters and least squares of an arm, against Pinocchio's inverse dynamics."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.arm.base import base_of
from estimation.arm.identification import fit, thesis_weights
from estimation.arm.kinematics import ArmError
from estimation.arm.motion import joint_channels, motion_of
from estimation.arm.regressor import names, regressor
from estimation.arm.tables import PSM
from estimation.recording import Recording

PERIOD_S = 0.01


def excitation(seed: int, seconds: float = 12.0) -> np.ndarray:
    """Random finite Fourier series inside the joint limits, shape (n, 6)."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, PERIOD_S)[:, None]
    parts = sum(
        np.sin(2 * np.pi * 0.17 * k * time + rng.uniform(0, 6.28, 6)) * rng.uniform(0.3, 1, 6) / k
        for k in range(1, 6)
    )
    lower, upper = (np.array([getattr(j, n) for j in PSM.joints]) for n in ("lower", "upper"))
    return (lower + upper) / 2 + 0.35 * (upper - lower) * parts / np.abs(parts).max(axis=0)


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
    columns = regressor(PSM, motion_of(excitation(3, 30.0), PERIOD_S))[:, :, base.columns]
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
    columns = regressor(PSM, motion_of(excitation(4), PERIOD_S))
    torque = columns @ np.ones(68)
    with pytest.raises(ArmError, match="cannot be identified"):
        fit(columns, torque)
    assert np.isfinite(fit(columns, torque, damping=1e-6).values).all()


def test_joints_are_read_from_a_recordings_channels():
    time = np.arange(5) / 200
    columns = {
        "joint_1_angle_rad": time,
        "joint_1_velocity_rad_s": 2 * time,
        "joint_1_torque_n_m": 3 * time,
        "joint_2_position_m": 4 * time,
        "joint_2_velocity_m_s": 5 * time,
        "joint_2_force_n": 6 * time,
    }
    run = Recording(name="arm", time_s=time, columns=columns)
    position, velocity, torque = joint_channels(run)
    np.testing.assert_array_equal(position, np.column_stack([time, 4 * time]))
    np.testing.assert_array_equal(velocity, np.column_stack([2 * time, 5 * time]))
    np.testing.assert_array_equal(torque, np.column_stack([3 * time, 6 * time]))
    with pytest.raises(ArmError, match="no arm joints"):
        joint_channels(replace(run, columns={"motor_current_a": time}))
