"""Excitation within limits at every instant, and better told parameters than at the start."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.arm.excitation import (
    ACCELERATION_PER_SPEED,
    FUNDAMENTAL_HZ,
    condition,
    designed,
    fitted,
    start,
)
from estimation.arm.tables import PSM

pytest.importorskip("pinocchio", reason="Pinocchio is not installed (pip install 'rig[arm]')")


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.floats(0, 1))
def test_limits_hold_at_instants_nobody_looked_at(seed, phase):
    time = (np.arange(7919) + phase) / (7919 * FUNDAMENTAL_HZ)
    motion = fitted(PSM, start(PSM, seed)).motion(time)
    for k, joint in enumerate(PSM.joints):
        assert joint.lower <= motion.position[:, k].min()
        assert motion.position[:, k].max() <= joint.upper
        assert np.abs(motion.velocity[:, k]).max() <= joint.speed
        assert np.abs(motion.acceleration[:, k]).max() <= ACCELERATION_PER_SPEED * joint.speed


def test_velocity_and_acceleration_are_the_positions_derivatives():
    motion = fitted(PSM, start(PSM, 1)).motion(np.arange(0, 10, 0.001))
    inner = slice(5, -5)
    slope = np.gradient(motion.position, 0.001, axis=0)
    np.testing.assert_allclose(slope[inner], motion.velocity[inner], atol=1e-4)
    bend = np.gradient(motion.velocity, 0.001, axis=0)
    np.testing.assert_allclose(bend[inner], motion.acceleration[inner], atol=1e-3)


def test_the_design_tells_parameters_better_than_its_starts():
    starts = [condition(PSM, fitted(PSM, start(PSM, seed))) for seed in range(2)]
    found = condition(PSM, designed(PSM, seeds=2, evaluations=150))
    assert found < 0.7 * min(starts)
