"""Motions of the simulated seven-joint arm: free, with the gripper moving or held, and grasps.

Free paths are made as in Zhang et al. 2022: uniform random numbers, smoothed by two low-pass
filters, over the joints' limits. A run with a grasp begins with free motion, from which the arm
comes to its pose, so that cables are in a state that history explains. The authors hold a
force-sensing resistor; here it has errors of gain, hysteresis and noise. Their calibration curve
ends at 1.76 N, less than their forces, so it is not used.
"""

from dataclasses import dataclass

import numpy as np
from scipy import signal

from estimation.arm.motion import Motion
from estimation.arm.tables import PSM
from estimation.recording import FloatArray
from rig.arm.hidden import bouc_wen
from rig.studies.zhang.psm import GRIPPER, RATE_HZ, WRIST, Psm

LEAD_SAMPLES = round(4.0 * RATE_HZ)
"""Before a run: the gripper closes from open, so that its cables are in a known state."""

HELD_S = 0.8
"""Time between two random numbers."""

SMOOTHING_HZ = 0.6
SHARE = 0.9
LEAST_OPEN = 0.05
SPEED_SHARE = 0.6

ARM_M = 0.02
"""From the gripper's axis to what it holds: the inverse of the paper's 50 per metre."""

JAW_N_RAD = 15.0
"""Force by which a held thing answers the angle; assumed."""

OPEN_RAD, TOUCH_RAD, HELD_RAD = 0.8, 0.4, 0.2
PEAK_N = 4.24
"""Range of force of the paper's grasps: 0.37 N over 8.73 %."""

FREE_S, COMING_S = 12.0, 2.0
CONFIGURATIONS_DEG = ((0, 0), (60, 0), (30, 0), (0, 60), (0, 30))
"""J5 and J6 of C1 to C5."""

CONTACT_SHARE, CONTACT_DEPTH_M = 0.2, 0.05
"""Share of the ranges moved while touching, and insertion beyond the middle; assumed."""

TURN_S, STAY_S = 1.5, 3.0
SENSOR_GAIN, SENSOR_HYSTERESIS_N, SENSOR_NOISE_N = 0.02, 0.04, 0.02


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
    """Return the motion of a path (n, 6) and its gripper, held at an angle, rad, or of shape (n,).

    Before it is a lead in which the gripper closes from `open_rad`.
    """
    held = np.broadcast_to(gripper, len(path))
    closing = _ease(np.array([open_rad]), held[:1], LEAD_SAMPLES)[:, 0]
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


@dataclass(frozen=True)
class Grasp:
    """A run with something between the jaws."""

    motion: Motion  # the arm's motion as it is measured, lead included
    touching: FloatArray  # whether, or how far, the tip may touch its surroundings, shape (n,)
    scored: np.ndarray  # samples of the experiment itself, shape (n,)

    def force(self, psm: Psm) -> FloatArray:
        """Return the force on what is held, N: the true angle differs from the measured one."""
        wrist = self.motion.position[:, WRIST]
        true_by_measured = psm.true_coupling @ np.linalg.inv(psm.nominal_coupling)
        off = (wrist @ (true_by_measured - np.eye(4)).T)[:, 3]
        first = int(np.argmax(self.scored))
        angle = self.motion.position[:, GRIPPER] + off - off[first]
        deep = np.maximum(TOUCH_RAD - angle, 0.0)
        return np.where(self.scored, JAW_N_RAD * deep, 0.0)

    def sensed(self, force: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return the reading of a force-sensing resistor for a force, N."""
        gain = 1 + SENSOR_GAIN * rng.normal()
        late = SENSOR_HYSTERESIS_N * bouc_wen(force[:, None], np.array([0.5]))[:, 0]
        return gain * force + late + SENSOR_NOISE_N * rng.normal(size=len(force))


def grasp_and_release(rng: np.random.Generator) -> Grasp:
    """Return 13 s of grasping and letting go at a fixed pose, as in the paper's Figure 8."""
    seconds = 13.0
    time = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    deepest = PEAK_N / JAW_N_RAD
    cycles = (1 - np.cos(2 * np.pi * time / (seconds / rng.integers(3, 6)))) / 2
    closed = 1.1 * deepest * np.minimum(cycles, 1 / 1.1)
    pose = 0.4 * (random_path(rng, 1.0)[0] - _middle()) + _middle()
    return _run(rng, np.tile(pose, (len(time), 1)), TOUCH_RAD - closed, np.zeros(len(time)))


def configurations(rng: np.random.Generator) -> tuple[Grasp, np.ndarray]:
    """Return a grasp held in C1 to C5, and for each sample the configuration held, or -1."""
    pose = np.array([0.0, 0.0, 0.135, 0.0, 0.0, 0.0])
    turn, stay = round(TURN_S * RATE_HZ), round(STAY_S * RATE_HZ)
    path, place, last = [], [], pose
    for k, angles in enumerate(CONFIGURATIONS_DEG):
        there = pose.copy()
        there[4:6] = np.radians(angles)
        path += [_ease(last, there, turn), np.tile(there, (stay, 1))]
        place += [-1] * turn + [k] * stay
        last = there
    held = np.full(len(place), HELD_RAD)
    grasp = _run(rng, np.concatenate(path), held, np.zeros(len(place)))
    before = len(grasp.motion) - len(place)
    return grasp, np.concatenate([np.full(before, -1), place])


def contact_path(rng: np.random.Generator) -> Grasp:
    """Return 40 s of small motion deep in the insertion with a held thing, as of pushing a wall.

    The tip is free for the first 10 s.
    """
    seconds = 40.0
    middle = _middle()
    path = middle + CONTACT_SHARE * (random_path(rng, seconds) - middle)
    path[:, 2] += CONTACT_DEPTH_M
    touching = np.clip(np.arange(len(path)) / RATE_HZ - 10.0, 0, 1)
    return _run(rng, path, np.full(len(path), HELD_RAD), touching)


def _run(
    rng: np.random.Generator, path: FloatArray, gripper: FloatArray, touching: FloatArray
) -> Grasp:
    """Put free motion, and the way from there, before an experiment."""
    free = random_path(rng, FREE_S)
    opened = moving_gripper(rng, FREE_S, OPEN_RAD)
    coming = round(COMING_S * RATE_HZ)
    way = _ease(free[-1], path[0], coming)
    wide = np.array([OPEN_RAD])
    opening, closing = _ease(opened[-1:], wide, coming), _ease(wide, gripper[:1], coming)
    motion = with_gripper(
        np.concatenate([free, way, np.repeat(path[:1], coming, axis=0), path]),
        np.concatenate([opened, opening[:, 0], closing[:, 0], gripper]),
        OPEN_RAD,
    )
    before = len(motion) - len(path)
    padded = np.concatenate([np.zeros(before), touching])
    return Grasp(motion, padded, np.arange(len(motion)) >= before)


def _middle() -> FloatArray:
    lower, upper, _ = PSM.limits
    return (lower + upper) / 2


def _ease(start: FloatArray, stop: FloatArray, samples: int) -> FloatArray:
    share = np.asarray((1 - np.cos(np.linspace(0, np.pi, samples))) / 2)
    return start + share[:, None] * (stop - start)
