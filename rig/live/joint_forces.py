"""The forces of a 3-DOF grasper's joints, from those of its three motors' axes.

Zhao and Nelson 2016, equations 12 to 14: the grasp is that of both jaws, their mean; the pitch that
of the jaw that touches, the one that presses harder; the yaw is its own motor's.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from estimation.recording import FloatArray
from rig.live.block import SampleBlock

AXES = ("yaw_force_n", "jaw_1_force_n", "jaw_2_force_n")
JOINTS = ("grasp_force_n", "pitch_force_n", "yaw_force_n")


def of_joints(axes: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return grasp and pitch force, N, where the forces of both jaws are there; else nothing."""
    if not {"jaw_1_force_n", "jaw_2_force_n"} <= set(axes):
        return {}
    jaws = np.stack([axes["jaw_1_force_n"], axes["jaw_2_force_n"]])
    return {"grasp_force_n": jaws.mean(axis=0), "pitch_force_n": jaws.max(axis=0)}


def interval_of_joints(half_widths: Mapping[str, float]) -> dict[str, float]:
    """Return half of the 95 % intervals with those of grasp and pitch, N.

    The jaws' errors are taken to agree: friction that is not known errs the same way in both.
    """
    if not {"jaw_1_force_n", "jaw_2_force_n"} <= set(half_widths):
        return dict(half_widths)
    jaws = half_widths["jaw_1_force_n"], half_widths["jaw_2_force_n"]
    return {**half_widths, "grasp_force_n": sum(jaws) / 2, "pitch_force_n": max(jaws)}


def with_joint_forces(block: SampleBlock) -> SampleBlock:
    """Return a block with grasp and pitch force in addition to the jaws'."""
    return replace(
        block,
        columns={**block.columns, **of_joints(block.columns)},
        estimates={**block.estimates, **of_joints(block.estimates)},
    )
