"""An arm's kinematics against products of its table's transforms, written out in NumPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.arm.kinematics import tip_pose
from estimation.arm.tables import PSM, DhRow
from estimation.arm.wrench import body_jacobians, spatial_jacobians

pytest.importorskip("pinocchio", reason="Pinocchio is not installed (extra arm)")

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


@given(within_limits)
def test_the_jacobians_are_the_derivative_of_the_tips_pose(q):
    (spatial,), (body,) = spatial_jacobians(PSM, q[None]), body_jacobians(PSM, q[None])
    back = np.linalg.inv(joint_frames(q)[-1])
    for k, h in enumerate(1e-6 * np.eye(6)):
        rate = (joint_frames(q + h)[-1] - joint_frames(q - h)[-1]) / 2e-6
        for jacobian, twist in ((spatial, rate @ back), (body, back @ rate)):
            linear, angular = twist[:3, 3], (twist[2, 1], twist[0, 2], twist[1, 0])
            np.testing.assert_allclose(jacobian[:, k], [*linear, *angular], atol=1e-8)
