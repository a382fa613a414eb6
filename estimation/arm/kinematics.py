"""Kinematics of an arm by Pinocchio, from its table and without a URDF file."""

from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from estimation.arm.tables import Arm, DhRow
from estimation.errors import EstimationError, MissingExtraError
from estimation.recording import FloatArray

TIP = "tip"


class ArmError(EstimationError):
    """An arm's motion does not fit the arm, or does not identify its parameters."""


def optional(module: str, need: str) -> Any:
    """Return a module of the extra `arm`, for a need in words; MissingExtraError without it."""
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingExtraError(f"{need}, which is not installed.", "", "arm") from error


def pinocchio() -> Any:
    """Return the Pinocchio module, or raise MissingExtraError."""
    return optional("pinocchio", "Arm dynamics need Pinocchio")


@lru_cache(maxsize=8)
def built(arm: Arm) -> Any:
    """Return the arm as a `pinocchio.Model`: massless links, a frame called `tip`, gravity set.

    Its joints are those of all bodies; `Arm.closure` gives their positions.
    """
    pin = pinocchio()
    model = pin.Model()
    model.name = arm.name
    model.gravity = pin.Motion(np.array(arm.gravity_m_s2), np.zeros(3))
    for body in arm.bodies:
        moves = pin.JointModelPZ() if body.prismatic else pin.JointModelRZ()
        joint = model.addJoint(body.parent, moves, _placement(pin, body.row), body.name)
        model.appendBodyToJoint(joint, pin.Inertia.Zero(), pin.SE3.Identity())
    last, placement = arm.tip_body or len(arm.joints), _placement(pin, arm.tip)
    model.addFrame(pin.Frame(TIP, last, 0, placement, pin.FrameType.OP_FRAME))
    return model


def _placement(pin: Any, row: DhRow) -> Any:
    about_x = pin.SE3(pin.utils.rotate("x", row.alpha_rad), np.array([row.a_m, 0.0, 0.0]))
    about_z = pin.SE3(pin.utils.rotate("z", row.theta_rad), np.array([0.0, 0.0, row.d_m]))
    return about_x * about_z


def tip_pose(arm: Arm, position: FloatArray) -> FloatArray:
    """Return where the tip is in the base frame, a homogeneous transform, shape (4, 4), m.

    The joints' positions, shape (joints,), are in rad or m; see `check_positions`.
    """
    q = np.asarray(position, dtype=np.float64)
    check_positions(arm, q[None])
    pin, model = pinocchio(), built(arm)
    data = model.createData()
    pin.framesForwardKinematics(model, data, arm.closure @ q if arm.loops else q)
    return np.asarray(data.oMf[model.getFrameId(TIP)].homogeneous)


def check_positions(arm: Arm, position: FloatArray) -> None:
    """Raise ArmError unless positions, shape (n, joints), are finite and of an arm's joints."""
    if position.shape[1:] != (len(arm.joints),) or not np.isfinite(position).all():
        raise ArmError(
            f"Positions of shape {position.shape} do not fit {arm.name}.",
            f"It has {len(arm.joints)} joints; every position must be finite.",
        )
