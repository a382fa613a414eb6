"""Recordings of the PSM for the tests of the arm's studies."""

import numpy as np

from estimation.arm.motion import JointNames
from estimation.arm.tables import PSM
from estimation.recording import FloatArray, Recording

RATE_HZ = 100.0


def waving(seconds: float, slowest_hz: float, share: float, rng: np.random.Generator) -> FloatArray:
    """Return positions (n, 7) of five waves each, over so much of half of the joints' ranges."""
    phase = 2 * np.pi * slowest_hz * np.arange(0, seconds, 1 / RATE_HZ)[:, None]
    waves = sum(np.sin(k * phase + rng.uniform(0, 6.28, 7)) / k for k in range(1, 6))
    limits = [*((joint.lower, joint.upper) for joint in PSM.joints), (0.0, 1.0)]
    lower, upper = np.array(limits).T
    return (lower + upper) / 2 + share * (upper - lower) * waves


def psm_recording(
    name: str, position: FloatArray, velocity: FloatArray, torque: FloatArray, rate_hz: float
) -> Recording:
    """Return a run of seven joints, the third of them prismatic; the gripper has no torque."""
    effort = np.column_stack([torque[:, :6], np.zeros(len(torque))])
    columns = {}
    for k in range(7):
        own = JointNames(k + 1, prismatic=k == 2)
        columns[own.position], columns[own.velocity] = position[:, k], velocity[:, k]
        columns[own.torque] = effort[:, k]
    return Recording(name, np.arange(len(position)) / rate_hz, columns)
