"""The compiled regressor against Pinocchio's, link by link, on serial arms and on trees."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.arm.kinematics import built
from estimation.arm.motion import Motion
from estimation.arm.regressor import regressor
from estimation.arm.tables import PSM, Arm
from rig.studies.delsol.hydraulic_arm import HYDRAULIC

pin = pytest.importorskip("pinocchio", reason="Pinocchio is not installed (extra arm)")

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
