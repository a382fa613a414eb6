"""The wrench at an arm's tip: offline against the truth, near singularities, and live."""

import numpy as np
import pytest

from estimation.arm.kinematics import ArmError
from estimation.arm.motion import Motion
from estimation.arm.regressor import names, regressor
from estimation.arm.tables import PSM
from estimation.arm.wrench import (
    LiveWrench,
    by_pseudo_inverse,
    most_likely,
    spatial_jacobians,
)

pytest.importorskip("pinocchio", reason="Pinocchio is not installed (extra arm)")

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
