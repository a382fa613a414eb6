"""A simulated patient-side manipulator with effects that its model does not declare.

The declared part is the thesis' own model with plausible parameters. The hidden part is Dahl
friction, friction that grows with another joint's position, and a slow drift, or a drawn family of
the same size (`rig.arm.hidden`). Its size is set by `HIDDEN_SHARE`, per joint.
"""

from dataclasses import dataclass, replace

import numpy as np

from estimation.arm.kinematics import tip_pose
from estimation.arm.motion import JointNames, Motion
from estimation.arm.regressor import names, regressor
from estimation.arm.tables import PSM
from estimation.arm.wrench import spatial_jacobians
from estimation.recording import FloatArray, Recording
from rig.arm.hidden import OWN, HiddenTorque, bouc_wen, draw_hidden

RATE_HZ = 100.0

HIDDEN_SHARE = np.array([0.055, 0.22, 1.1, 0.33, 2.6, 6.0])
"""Hidden torque of each joint, as a share of its declared torque's RMS on the excitation. Set so
that the thesis' own method meets the thesis' table 3.2 on this arm."""

NOISE_SHARE = 0.005
"""White noise of the torque, as a share of the same."""

HAND_SHARE = np.array([0.2, 0.7, 0.07, 0.35, 0.55, 0.35])
"""Shares of the joints' ranges that a hand uses; assumed, the thesis does not state its motion."""

CONTACT_SHARE = 0.05
CONTACT_DEPTH_M = 0.04
"""Share of the ranges moved while touching a pin, which is fixed, and insertion beyond the middle;
the thesis states neither. The share is set so that its method meets its table 3.3."""

GRIP_N_M = 0.055
"""Torsion at which a pin turns in the gripper instead of passing it on; the thesis writes of a bad
grip and states no number: set so that its method meets its table 3.3."""

SEED_SPREAD = 0.25
"""Standard deviation of the logarithm of every parameter and hidden strength between arms."""


@dataclass(frozen=True)
class SimulatedArm:
    """One arm drawn at random around the plausible one."""

    values: FloatArray  # declared, in the order of `estimation.arm.regressor.names`
    hidden: FloatArray  # strengths of friction, drift and cross friction, shape (3, joints)
    slip: FloatArray  # displacement over which its Dahl friction turns, rad or m, shape (joints,)
    form: HiddenTorque | None = None  # of a drawn family, in place of those


def recorded(name: str, position: FloatArray, torque: FloatArray, rate_hz: float) -> Recording:
    """Return an arm's positions and torques, (n, joints) each, as a recording.

    Six joints are the PSM's, others turn.
    """
    slides = position.shape[1] == len(PSM.joints)
    columns = {}
    for k in range(position.shape[1]):
        names = JointNames(k + 1, slides and PSM.joints[k].kind == "prismatic")
        columns[names.position] = position[:, k]
        columns[names.velocity] = np.gradient(position[:, k], 1 / rate_hz)
        columns[names.torque] = torque[:, k]
    return Recording(name, np.arange(len(position)) / rate_hz, columns)


@dataclass(frozen=True)
class ArmRun:
    """The readings of the arm's own sensors in a run, (n, joints), and the true wrench, (n, 6).

    It is the spatial wrench of the tip on its surroundings.
    """

    position: FloatArray
    torque: FloatArray
    wrench: FloatArray


def draw_arm(rng: np.random.Generator, family: str = OWN) -> SimulatedArm:
    """Draw an arm, whose hidden torque is of a family of `rig.arm.hidden`."""
    values = np.array([_plausible(name) for name in names(PSM)])
    values = values * np.exp(SEED_SPREAD * rng.normal(size=len(values)))
    lower, upper, _ = PSM.limits
    reach = upper - lower
    motion = smooth_motion(rng, 20.0, top_hz=0.5, share=1.0)
    declared = np.std(regressor(PSM, motion) @ values, axis=0)
    scale = HIDDEN_SHARE * declared
    hidden = scale * np.exp(SEED_SPREAD * rng.normal(size=(3, len(scale))))
    arm = SimulatedArm(values, hidden, 0.01 * reach * np.exp(SEED_SPREAD * rng.normal(size=6)))
    if family == OWN:
        return arm
    rms = np.std(hidden_torque(arm, motion), axis=0)
    return replace(arm, form=draw_hidden(family, rng, motion, rms))


def hidden_torque(arm: SimulatedArm, motion: Motion) -> FloatArray:
    """Return the torque that no model declares, along a motion, shape (n, joints)."""
    if arm.form is not None:
        return arm.form(motion)
    friction = bouc_wen(motion.position, arm.slip)
    middle = motion.position - motion.position.mean(axis=0)
    share = np.abs(middle) / np.abs(middle).max(axis=0)
    cross = friction * np.roll(share, 1, axis=1)
    drift = np.linspace(-0.5, 0.5, len(motion))[:, None] * np.ones(6)
    hidden = arm.hidden[0] * friction + arm.hidden[1] * cross
    return np.asarray(hidden + 0.3 * arm.hidden[2] * drift)


_LINKS = {"m": (4.0, 2.0, 0.4), "lz": (0.3, -0.3, -0.13), "ly": (0.2, -0.25, 0.02)}
_OWN = {
    "Ke": (1.2, 0.4, 0.0, 0.0022, 0.0, 0.0),
    "Fv": (0.11, 0.29, 1.3, 0.0015, 0.027, 0.014),
    "Fs": (0.14, 0.19, 0.9, 0.003, 0.0126, 0.004),
    "Ia": (0.05, 0.08, 0.7, 1e-4, 1e-3, 1e-3),
    "tau0_": (-0.33, -0.01, 0.48, -0.005, 0.002, 0.008),
}


def _plausible(name: str) -> float:
    """Return a parameter: frictions and springs near the thesis' table 2.2, links assumed."""
    if name in ("Fv56", "Fv65"):
        return 0.009
    kind, joint = name[:-1], int(name[-1]) - 1
    if kind in _OWN:
        return _OWN[kind][joint]
    if kind in _LINKS and joint < 3:
        return _LINKS[kind][joint]
    if kind in ("Lxx", "Lyy", "Lzz"):
        return (0.1, 0.1, 0.05)[joint]
    return 5e-4 if kind == "lx" and joint > 2 else 0.0


def excitation(rng: np.random.Generator, seconds: float = 60.0) -> Motion:
    """Return a finite Fourier series of five harmonics of 0.1 Hz, equation 2.14, within limits."""
    time = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    return _fourier(rng, time, 0.1 * np.arange(1.0, 6.0))


def smooth_motion(
    rng: np.random.Generator,
    seconds: float,
    top_hz: float = 0.35,
    share: float | FloatArray = HAND_SHARE,
) -> Motion:
    """Return motion as of a hand: many frequencies that do not repeat, in a share of the range."""
    time = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    return _fourier(rng, time, rng.uniform(0.03, top_hz, 14), share)


def _fourier(
    rng: np.random.Generator,
    time: FloatArray,
    frequencies_hz: FloatArray,
    share: float | FloatArray = 1.0,
) -> Motion:
    lower, upper, speed = PSM.limits
    pulse = 2 * np.pi * frequencies_hz
    size = rng.normal(size=(len(pulse), 6)) / np.sqrt(frequencies_hz)[:, None]
    phase = np.outer(time, pulse)[:, :, None] + rng.uniform(0, 2 * np.pi, (len(pulse), 6))
    position = np.einsum("tkj,kj->tj", np.sin(phase), size)
    velocity = np.einsum("tkj,kj->tj", np.cos(phase), size * pulse[:, None])
    reach = np.abs(position).max(axis=0) / (0.45 * share * (upper - lower))
    factor = 1 / np.maximum(reach, np.abs(velocity).max(axis=0) / (0.9 * speed))
    acceleration = -np.einsum("tkj,kj->tj", np.sin(phase), size * pulse[:, None] ** 2)
    middle = (lower + upper) / 2
    return Motion(middle + factor * position, factor * velocity, factor * acceleration, 1 / RATE_HZ)


def contact_motion(rng: np.random.Generator, seconds: float) -> Motion:
    """Return slow, small motion around a pose deep in the insertion, as of touching a pin."""
    motion = smooth_motion(rng, seconds, top_hz=0.25, share=CONTACT_SHARE)
    shift = np.array([0.0, 0.0, CONTACT_DEPTH_M, 0.0, 0.0, 0.0])
    return replace(motion, position=motion.position + shift)


def contact(rng: np.random.Generator, motion: Motion) -> FloatArray:
    """Return spatial wrenches of touching and letting go in turns: up to 7 N, smooth."""
    waves, touching = _touching(rng, motion)
    force = waves * (touching * rng.uniform(5, 7) / np.abs(waves).max())[:, None]
    return _of_tip(rng, motion, force, 0.1 * touching)


def pin(
    rng: np.random.Generator,
    motion: Motion,
    largest_n: tuple[float, float, float],
    torsion_n_m: float,
) -> FloatArray:
    """Return spatial wrenches of touching a pin in turns.

    They have a largest force along each axis of the base, and a largest torsion about the shaft.
    """
    waves, touching = _touching(rng, motion)
    force = waves * touching[:, None] * np.array(largest_n) / np.abs(waves).max(axis=0)
    return _of_tip(rng, motion, force, torsion_n_m * touching)


def passed_on(motion: Motion, wrench: FloatArray) -> FloatArray:
    """Return the wrench that a pin transmits: beyond `GRIP_N_M` it turns in the gripper."""
    axis, tip = _shaft(motion)
    torsion = np.einsum("ni,ni->n", wrench[:, 3:] - np.cross(tip, wrench[:, :3]), axis)
    lost = torsion - np.clip(torsion, -GRIP_N_M, GRIP_N_M)
    return np.hstack([wrench[:, :3], wrench[:, 3:] - lost[:, None] * axis])


def _touching(rng: np.random.Generator, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return smooth periodic motions along three axes, shape (n, 3), and the tip contact, (n,)."""
    time = np.arange(len(motion)) * motion.period_s
    waves = np.zeros((len(motion), 3))
    for f in rng.uniform(0.1, 0.7, 5):
        waves += np.sin(2 * np.pi * f * time[:, None] + rng.uniform(0, 6.28, 3))
    touching: FloatArray = np.clip(3 * np.sin(2 * np.pi * 0.08 * time + rng.uniform(0, 6.28)), 0, 1)
    return waves, touching


def _of_tip(
    rng: np.random.Generator, motion: Motion, force: FloatArray, torsion_n_m: FloatArray
) -> FloatArray:
    """Return the spatial wrench of a force at the tip and of a torsion of a size to and fro."""
    time = np.arange(len(motion)) * motion.period_s
    twist = torsion_n_m * np.sin(2 * np.pi * 0.3 * time + rng.uniform(0, 6.28))
    axis, tip = _shaft(motion)
    return np.hstack([force, np.cross(tip, force) + twist[:, None] * axis])


def _shaft(motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return the shaft's axis and the tip, shape (n, 3) each."""
    tips = np.array([tip_pose(PSM, q[:6])[:3, [2, 3]] for q in motion.position])
    return tips[:, :, 0], tips[:, :, 1]


def simulate(
    arm: SimulatedArm, motion: Motion, rng: np.random.Generator, wrench: FloatArray | None = None
) -> ArmRun:
    """Return the readings of the arm's sensors in a motion, with a tip wrench or in free space."""
    declared = regressor(PSM, motion) @ arm.values
    applied = np.zeros((len(motion), 6)) if wrench is None else wrench
    external = np.einsum("nij,ni->nj", spatial_jacobians(PSM, motion.position), applied)
    noise = NOISE_SHARE * np.std(declared, axis=0) * rng.normal(size=declared.shape)
    counts = 2e-5 * rng.normal(size=motion.position.shape) * np.ptp(motion.position, axis=0)
    return ArmRun(
        motion.position + counts, declared + hidden_torque(arm, motion) + external + noise, applied
    )
