"""The small network on the residual of our model of a seven-joint arm.

The residual is mostly friction with memory, which presliding springs model only approximately.
It does not follow from a joint's position and velocity alone, so the inputs of each network include
the deflections of such springs too, of the joint itself or, in the wrist, of the motors behind the
coupling.
"""

from collections.abc import Sequence

import numpy as np

from estimation.arm.elements import slip
from estimation.arm.motion import Motion
from estimation.arm.tables import PSM, Arm
from estimation.networks.network import Network
from estimation.networks.training import Settings, train
from estimation.recording import FloatArray

JOINT_SLIP_SHARE = (0.01, 0.03, 0.06, 0.1, 0.2, 0.4)
"""Ways after which the springs of joints 1 to 4 slip, as shares of half a joint's range."""

MOTOR_SLIP_RAD = (0.03, 0.1, 0.2, 0.4)
"""The same of the wrist's motors."""

SETTINGS = Settings(nodes=4, iterations=60)

HELD_OUT = 6
"""Every so many pieces of the samples choose the step, and whether the network is kept."""

LEAST_GAIN = 0.1
"""Share of the squared residual on those segments that a network must remove to be kept. Below,
it fits noise: the residual does not depend on these states."""


def rest_rows(arm: Arm, joint: int, motion: Motion) -> FloatArray:
    """Return the states that the network on a joint's rest takes, shape (n, inputs).

    Args:
        arm: The arm with its instrument's nominal coupling.
        joint: The joint, from 0.
        motion: Its motion, gripper included, walked from its start.
    """
    wrist = len(PSM.joints) if arm.wrist is None else arm.wrist
    if joint < wrist:
        half = (arm.joints[joint].upper - arm.joints[joint].lower) / 2
        position, velocity = motion.position[:, [joint]], motion.velocity[:, [joint]]
        ways = [share * half for share in JOINT_SLIP_SHARE]
    else:
        inverse = np.linalg.inv(np.array(arm.wrist_coupling)).T
        driven = slice(wrist, wrist + len(inverse))
        position, velocity = (x[:, driven] @ inverse for x in (motion.position, motion.velocity))
        ways = list(MOTOR_SLIP_RAD)
    return np.hstack([position, velocity, *(slip(position, way) for way in ways)])


def rest_network(rows: FloatArray, left: FloatArray) -> Network | None:
    """Return a network on a model's residual; None where it improves held-out segments too little.

    Args:
        rows: Its inputs, shape (n, inputs).
        left: Residual, shape (n,).
    """
    piece = np.arange(len(rows)) * 3 * HELD_OUT // len(rows)
    out = piece % HELD_OUT == HELD_OUT - 1
    names: Sequence[str] = [f"state {k}" for k in range(rows.shape[1])]
    network = train(
        rows[~out],
        left[~out, None],
        (names, ("rest",)),
        SETTINGS,
        validation=(rows[out], left[out, None]),
    ).network
    after = np.sum((left[out] - network(rows[out])[:, 0]) ** 2)
    return network if after < (1 - LEAST_GAIN) * np.sum(left[out] ** 2) else None
