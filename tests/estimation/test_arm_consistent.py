"""The arm with its loops, and fits that keep to what a real arm can be."""

import numpy as np
import pytest

from estimation.arm.base import base_of
from estimation.arm.consistent import consistent_fit, pseudo_inertia
from estimation.arm.identification import fit, thesis_weights
from estimation.arm.motion import Motion
from estimation.arm.recursion import LINK
from estimation.arm.regressor import names, regressor
from estimation.arm.tables import PSM, PSM_CLOSED, Arm
from rig.arm.simulated import excitation

pytest.importorskip("clarabel", reason="Clarabel is not installed (extra arm)")


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


@pytest.mark.parametrize("arm", [PSM, PSM_CLOSED], ids=["serial", "closed chain"])
def test_a_real_arm_is_found_and_an_unreal_fit_is_kept_from(arm: Arm):
    base = base_of(arm)
    columns = regressor(arm, excitation(np.random.default_rng(1), 20.0))[:, :, base.columns]
    truth = base.mapping @ real_arm(arm)
    torque = columns @ truth
    weights = thesis_weights(torque)
    found = consistent_fit(arm, columns, torque, weights)
    scale = np.abs(torque).max()
    np.testing.assert_allclose(columns @ found.base, torque, atol=2e-3 * scale)

    negative = truth.copy()
    negative[base.names.index("Fv1")] = -1.0
    torque = columns @ negative
    free = fit(columns, torque, weights).values
    held = consistent_fit(arm, columns, torque, weights)
    assert free[base.names.index("Fv1")] == pytest.approx(-1.0, abs=1e-6)
    assert held.base[base.names.index("Fv1")] > -1e-6
    for body in arm.bodies:
        if body.link == "full":
            link = [held.values[names(arm).index(f"{name}{body.label}")] for name in LINK]
            assert np.linalg.eigvalsh(pseudo_inertia(np.array(link))).min() > -1e-6


def test_the_counterweights_gravity_pulls_against_the_insertion():
    still = np.zeros((1, 6))
    values = np.zeros(len(names(PSM_CLOSED)))
    values[names(PSM_CLOSED).index("mc")] = 2.0
    values[names(PSM_CLOSED).index("m3")] = 2.0
    motion = Motion(still, still, still, 0.01)
    assert (regressor(PSM_CLOSED, motion) @ values)[0, 2] == pytest.approx(0.0, abs=1e-9)
