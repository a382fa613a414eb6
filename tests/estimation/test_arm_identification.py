"""Regressor, base parameters and least squares of an arm, against Pinocchio's inverse dynamics."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.arm.base import base_of
from estimation.arm.identification import fit, thesis_weights
from estimation.arm.kinematics import ArmError
from estimation.arm.motion import joint_channels
from estimation.arm.regressor import names, regressor
from estimation.arm.tables import PSM
from estimation.recording import Recording
from rig.arm.simulated import excitation


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
