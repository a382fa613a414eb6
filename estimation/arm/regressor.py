"""Regressor of an arm: its joint torques as columns times parameters, tau = Y delta.

Links by Pinocchio's torque regressor (parameters about the joint's origin: mass, first moments,
inertia); then springs, viscous and Coulomb friction, drive inertia and offsets (equation 2.5 of
G. A. Piqué's thesis, 2018).
"""

import numpy as np

from estimation.arm.kinematics import ArmError, built, pinocchio
from estimation.arm.motion import Motion
from estimation.arm.tables import Arm
from estimation.recording import FloatArray

LINK = ("m", "lx", "ly", "lz", "Lxx", "Lxy", "Lyy", "Lxz", "Lyz", "Lzz")
"""A link's parameters in Pinocchio's order: kg, kg m, kg m^2; about the joint's origin."""

SIGN_WIDTH = 0.005
"""Share of a joint's top speed over which Coulomb friction changes sign: tanh(velocity / width)."""


def names(arm: Arm) -> tuple[str, ...]:
    """Return the names of the columns of `regressor`; numbers count joints from 1."""
    own = [
        f"{parameter}{k + 1}"
        for k, joint in enumerate(arm.joints)
        for parameter in (LINK if joint.link == "full" else LINK[1:4])
    ]
    own += [f"Ke{k + 1}" for k, joint in enumerate(arm.joints) if joint.spring]
    every = range(1, len(arm.joints) + 1)
    own += [f"Fv{k}" for k in every]
    own += [f"Fv{row + 1}{column + 1}" for row, column in arm.viscous_pairs]
    for letter in ("Fs", "Ia", "tau0_"):
        own += [f"{letter}{k}" for k in every]
    return tuple(own)


def regressor(arm: Arm, motion: Motion) -> FloatArray:
    """Return the torque regressor of an arm along a motion.

    Args:
        arm: The arm.
        motion: Its motion; joints beyond the arm's own, such as a jaw, are not looked at.

    Returns:
        Shape (n, joints, columns), columns as in `names`.

    Raises:
        ArmError: The motion has fewer joints than the arm, or is not finite.
    """
    joints = len(arm.joints)
    q, v, a = (x[:, :joints] for x in (motion.position, motion.velocity, motion.acceleration))
    if q.shape[1] < joints or not all(np.isfinite(x).all() for x in (q, v, a)):
        raise ArmError(
            f"A motion of shape {motion.position.shape} does not fit {arm.name}.",
            f"It needs {joints} joints and finite values.",
        )
    width = SIGN_WIDTH * np.array([joint.speed for joint in arm.joints])
    springs = [k for k, joint in enumerate(arm.joints) if joint.spring]
    coupled = np.zeros((len(q), joints, len(arm.viscous_pairs)))
    for column, (row, other) in enumerate(arm.viscous_pairs):
        coupled[:, row, column] = v[:, other]
    return np.concatenate(
        [
            _links(arm, q, v, a),
            on_own_joint(q)[:, :, springs],
            on_own_joint(v),
            coupled,
            on_own_joint(np.tanh(v / width)),
            on_own_joint(a),
            on_own_joint(np.ones_like(q)),
        ],
        axis=2,
    )


def on_own_joint(values: FloatArray) -> FloatArray:
    """Return columns that act on their own joint only: (n, joints) to (n, joints, joints)."""
    columns: FloatArray = values[:, :, None] * np.eye(values.shape[1])
    return columns


def _links(arm: Arm, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """Return the columns of the links' parameters that count."""
    model, compute = built(arm), pinocchio().computeJointTorqueRegressor
    data = model.createData()
    full = np.empty((len(q), len(arm.joints), len(LINK) * len(arm.joints)))
    for k in range(len(q)):
        full[k] = compute(model, data, q[k], v[k], a[k])
    kept = [
        len(LINK) * k + j
        for k, joint in enumerate(arm.joints)
        for j in (range(len(LINK)) if joint.link == "full" else range(1, 4))
    ]
    return full[:, :, kept]
