"""Motions of the simulated seven-joint arm: free, with the gripper moving or held, and in contact.

Free paths are made as in Zhang et al. 2022: uniform random numbers, smoothed by two low-pass
filters, over the joints' limits.
"""

import numpy as np
from scipy import signal

from estimation.arm.motion import Motion
from estimation.arm.tables import PSM
from estimation.recording import FloatArray
from rig.studies.zhang.psm import RATE_HZ

LEAD_SAMPLES = round(4.0 * RATE_HZ)
"""Before a run: the gripper closes from open, so that its cables are in a known state."""

HELD_S = 0.8
"""Time between two random numbers."""

SMOOTHING_HZ = 0.6
SHARE = 0.9
LEAST_OPEN = 0.05
SPEED_SHARE = 0.6


def random_path(rng: np.random.Generator, seconds: float) -> FloatArray:
    """Return a path of the six joints over their limits, shape (n, 6)."""
    lower, upper, speed = PSM.limits
    raw = _smooth_random(rng, seconds, len(lower))
    fastest = np.abs(np.gradient(raw, 1 / RATE_HZ, axis=0)).max(axis=0)
    size = np.minimum(SHARE * (upper - lower) / 2, SPEED_SHARE * speed / fastest)
    return np.asarray((lower + upper) / 2 + size * raw)


def moving_gripper(rng: np.random.Generator, seconds: float, open_rad: float) -> FloatArray:
    """Return a path of a gripper that opens and closes at random, shape (n,)."""
    share = (_smooth_random(rng, seconds, 1)[:, 0] + 1) / 2
    return open_rad * (LEAST_OPEN + (1 - LEAST_OPEN) * share)


def with_gripper(path: FloatArray, gripper: FloatArray | float, open_rad: float) -> Motion:
    """Return the motion of a path and its gripper, after a lead in which the gripper closes.

    Args:
        path: Of the six joints, shape (n, 6).
        gripper: Of the gripper, shape (n,), or the angle at which it is held, rad.
        open_rad: Where the gripper starts from.
    """
    held = np.broadcast_to(gripper, len(path))
    ease = (1 - np.cos(np.linspace(0, np.pi, LEAD_SAMPLES))) / 2
    closing = open_rad + ease * (held[0] - open_rad)
    whole = np.vstack([np.repeat(path[:1], LEAD_SAMPLES, axis=0), path])
    position = np.column_stack([whole, np.concatenate([closing, held])])
    velocity = np.gradient(position, 1 / RATE_HZ, axis=0)
    return Motion(position, velocity, np.gradient(velocity, 1 / RATE_HZ, axis=0), 1 / RATE_HZ)


def _smooth_random(rng: np.random.Generator, seconds: float, columns: int) -> FloatArray:
    """Return smoothed random numbers, each column between -1 and 1, shape (n, columns)."""
    settle = round(10 * RATE_HZ)
    samples = round(seconds * RATE_HZ) + settle
    every = round(HELD_S * RATE_HZ)
    raw = np.repeat(rng.uniform(-1, 1, (samples // every + 1, columns)), every, axis=0)[:samples]
    low_pass = signal.butter(2, SMOOTHING_HZ, fs=RATE_HZ, output="sos")
    for _ in range(2):
        raw = signal.sosfilt(low_pass, raw, axis=0)
    smooth = raw[settle:]
    middle = (smooth.max(axis=0) + smooth.min(axis=0)) / 2
    return np.asarray((smooth - middle) / (np.ptp(smooth, axis=0) / 2))
