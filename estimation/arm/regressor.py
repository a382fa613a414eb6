"""Regressor of an arm: its joint torques as columns times parameters, tau = Y delta.

Links (parameters about the joint's origin: mass, first moments, inertia); then springs, viscous and
Coulomb friction, drive inertia and offsets (equation 2.5 of G. A. Piqué's thesis, 2018). Of a
hydraulic arm the links and two frictions of every body (E. del Sol et al. 2014, equations 4 to 7).
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from estimation.arm.kinematics import ArmError
from estimation.arm.motion import Motion
from estimation.arm.recursion import COUNTING, LINK, Tree, fill_links
from estimation.arm.tables import Arm
from estimation.recording import FloatArray

FRICTION = ("fc", "fv")
"""Coulomb and viscous friction of a body of a hydraulic arm."""

SIGN_WIDTH = 0.005
"""Share of a joint's top speed over which Coulomb friction changes sign: tanh(velocity / width)."""


def names(arm: Arm) -> tuple[str, ...]:
    """Return the names of the columns of `regressor`; numbers count joints from 1."""
    own = [
        f"{parameter}{body.label or number}"
        for number, body in enumerate(arm.bodies, start=1)
        for parameter in LINK[COUNTING[body.link]]
    ]
    if arm.hydraulic:
        every = range(1, len(arm.bodies) + 1)
        return (*own, *(f"{name}{k}" for name in FRICTION for k in every))
    own += [f"Ke{k + 1}" for k, joint in enumerate(arm.joints) if joint.spring]
    every = range(1, len(arm.joints) + 1)
    own += [f"Fv{k}" for k in every]
    own += [f"Fv{row + 1}{column + 1}" for row, column in arm.viscous_pairs]
    for letter in ("Fs", "Ia", "tau0_"):
        own += [f"{letter}{k}" for k in every]
    return tuple(own)


def regressor(arm: Arm, motion: Motion) -> FloatArray:
    """Return the torque regressor along a motion, (n, joints, columns), columns as in `names`.

    Joints beyond the arm's own, such as a jaw, are not looked at.

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
    to = _link_columns(arm)
    at = int(to.max()) + 1
    width = sign_width(arm)
    if arm.loops:
        closure = arm.closure
        links = np.zeros((len(q), len(closure), at))
        moved = q @ closure.T, v @ closure.T, a @ closure.T
        fill_links(_tree(arm), moved, to, links)
        table[:, :, :at] = closure.T @ links
        if arm.hydraulic:
            speeds = moved[1]
            rubbing = np.hstack([np.tanh(speeds / width.max()), speeds])
            table[:, :, at:] = rubbing[:, None, :] * np.tile(closure.T, 2)
            return table
    else:
        fill_links(_tree(arm), (q, v, a), to, table)
    own = (np.tanh(v / width), a, np.ones_like(q))
    springs = [k for k, joint in enumerate(arm.joints) if joint.spring]
    damped = [(k, k) for k in range(joints)]
    for values, places in (
        (q, [(k, k) for k in springs]),
        (v, [*damped, *arm.viscous_pairs]),
        *((each, damped) for each in own),
    ):
        for row, other in places:
            table[:, row, at] = values[:, other]
            at += 1
    return table


def sign_width(arm: Arm) -> FloatArray:
    """Return the speed over which each joint's Coulomb friction changes sign, shape (joints,)."""
    return SIGN_WIDTH * np.array([joint.speed for joint in arm.joints])


@lru_cache(maxsize=8)
def _tree(arm: Arm) -> Tree:
    return Tree.of(arm.bodies, arm.gravity_m_s2)


@lru_cache(maxsize=8)
def _link_columns(arm: Arm) -> NDArray[np.int64]:
    """Return the column of each body's parameters, -1 for those that do not count."""
    to, at = np.full((len(arm.bodies), len(LINK)), -1, np.int64), 0
    for k, body in enumerate(arm.bodies):
        counts = COUNTING[body.link]
        size = len(LINK[counts])
        to[k, counts] = np.arange(at, at + size)
        at += size
    return to
