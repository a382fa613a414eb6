"""Regressor of an arm: its joint torques as columns times parameters, tau = Y delta.

Links (parameters about the joint's origin: mass, first moments, inertia); then springs, viscous and
Coulomb friction, drive inertia and offsets (equation 2.5 of G. A. Piqué's thesis, 2018).
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from estimation.arm.kinematics import ArmError
from estimation.arm.motion import Motion
from estimation.arm.recursion import LINK, Tree, fill_links
from estimation.arm.tables import Arm
from estimation.recording import FloatArray

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
    table = np.zeros((len(q), joints, len(names(arm))))
    fill_links(_tree(arm), (q, v, a), _link_columns(arm), table)
    width = SIGN_WIDTH * np.array([joint.speed for joint in arm.joints])
    own = (np.tanh(v / width), a, np.ones_like(q))
    springs = [k for k, joint in enumerate(arm.joints) if joint.spring]
    damped = [(k, k) for k in range(joints)]
    at = int(_link_columns(arm).max()) + 1
    for values, places in (
        (q, [(k, k) for k in springs]),
        (v, [*damped, *arm.viscous_pairs]),
        *((each, damped) for each in own),
    ):
        for row, other in places:
            table[:, row, at] = values[:, other]
            at += 1
    return table


@lru_cache(maxsize=8)
def _tree(arm: Arm) -> Tree:
    return Tree.of(
        [joint.row for joint in arm.joints],
        [k - 1 for k in range(len(arm.joints))],
        [joint.kind == "prismatic" for joint in arm.joints],
        arm.gravity_m_s2,
    )


@lru_cache(maxsize=8)
def _link_columns(arm: Arm) -> NDArray[np.int64]:
    """Return the column of each link's parameters, -1 for those that do not count."""
    to, at = np.full((len(arm.joints), len(LINK)), -1, np.int64), 0
    for k, joint in enumerate(arm.joints):
        counts = slice(None) if joint.link == "full" else slice(1, 4)
        size = len(LINK[counts])
        to[k, counts] = np.arange(at, at + size)
        at += size
    return to
