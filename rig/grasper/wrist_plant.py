"""The whole simulated 3-DOF grasper: three motors that move three joints through its real coupling.

Motors are seen behind their gearheads (angle p), joints are q = B p, B being the coupling of the
wrist as it was built:

    N^2 J p'' = N K i - Fc tanh(p' / w) - b p' - B^T contact
    contact = k (q - q0) where q is beyond q0, of each joint
    tip = q - contact / cable stiffness

It complements `rig.grasper.plant`, which it cannot replace: there the axes are apart, their
friction has the memory that the paper's force estimates show, and a board is in the loop; here the
axes act on one another and stiff friction suffices, since only kinematics are studied. One plant of
both would need another choice of the hidden friction (decision 41), and every table with it.

The controller uses the designed geometry of the wrist. Where the two differ, as with a wrong pulley
ratio (equation 5 of Zhao and Nelson 2016), turning one joint moves another.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numba
import numpy as np

from estimation.recording import FloatArray, Recording
from rig.grasper.coupling import Coupling
from rig.grasper.wrist import MOTORS, CablePath, planetary_grasper
from rig.protocols.joints import JOINTS

RATE_HZ = 1000.0
SUBSTEPS = 10
RATIO, TORQUE_N_M_A, ROTOR_KG_M2 = 66.0, 14.6e-3, 2.7e-7
COULOMB_N_M, SMEAR_RAD_S, DAMPING_N_M_S_RAD = 6e-3, 0.02, 0.02
CABLE_N_M_RAD = 3.0
KP, KD = 12.0, 0.25
LIMIT_A = 0.6
TIP_NOISE_RAD, TORQUE_NOISE_N_M, CURRENT_NOISE_A, COUNT_RAD = 1e-3, 1e-4, 2e-3, 2 * np.pi / 2048

DESIGN = CablePath(0.004, 0.004, 0.005, 0.006, 0.008)
"""Pulleys with the ratio that decouples the jaws from the yaw; sizes are assumed."""


@dataclass(frozen=True)
class Wrist:
    """A grasper as designed, and as built with a pulley ratio d2 / d1, of which 1 decouples it."""

    pulley_ratio: float = 1.0

    @property
    def designed(self) -> Coupling:
        """The geometry of the controller and the declared model."""
        return planetary_grasper(DESIGN)

    @property
    def built(self) -> Coupling:
        """What moves."""
        return planetary_grasper(replace(DESIGN, d2_m=self.pulley_ratio * DESIGN.d1_m))


RUN_S = 10.0  # Length of each run


def wrist_campaign(wrist: Wrist, seed: int = 0, runs: int = 12) -> Iterator[Recording]:
    """Yield runs in which all joints move at once and press against springs, one after the other.

    The seed is that of motions, springs and noise.
    """
    random = np.random.default_rng(seed)
    for number in range(runs):
        asked = _motion(random, RUN_S)
        stiffness = np.exp(random.uniform(np.log(0.05), np.log(0.4), 3))
        yield play_wrist(f"wrist-{number:02d}", wrist, asked, stiffness, random)


def play_wrist(
    name: str,
    wrist: Wrist,
    joint_rad: FloatArray,
    spring_n_m_rad: FloatArray,
    random: np.random.Generator,
) -> Recording:
    """Return a run along a path of yaw, pitch and grasp, rad at 1 kHz, shape (n, 3).

    From its zero on each joint presses against a spring.
    """
    designed, built = wrist.designed, wrist.built
    sent = designed.actuator_position(joint_rad) / RATIO
    drum, current, contact = _run(
        np.ascontiguousarray(sent), built.jacobian * RATIO, np.asarray(spring_n_m_rad, np.float64)
    )
    n = len(drum)
    motor = np.round(drum * RATIO / COUNT_RAD) * COUNT_RAD
    angle = designed.joint_position(motor)
    tip = built.joint_position(drum * RATIO) - contact / CABLE_N_M_RAD
    current = current + CURRENT_NOISE_A * random.standard_normal((n, 3))
    shared = designed.joint_torque(current) * (designed.jacobian[0, 0], 1.0, 1.0)
    columns: dict[str, FloatArray] = dict(
        zip((f"{name}_angle_rad" for name in MOTORS), motor.T, strict=True)
    )
    for k, joint in enumerate(JOINTS):
        columns[f"{joint}_current_a"] = shared[:, k]
        columns[f"{joint}_angle_rad"] = angle[:, k]
        columns[f"{joint}_tip_angle_rad"] = tip[:, k] + TIP_NOISE_RAD * random.standard_normal(n)
        noise = TORQUE_NOISE_N_M * random.standard_normal(n)
        columns[f"{joint}_torque_n_m"] = contact[:, k] + noise
    return Recording(name, np.arange(n) / RATE_HZ, columns, rig="simulated grasper")


def _motion(random: np.random.Generator, duration_s: float) -> FloatArray:
    """Return sums of slow sines of each joint, beginning at rest, shape (n, 3)."""
    time_s = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    frequency = random.uniform(0.1, 0.7, (4, 3))
    phase = random.uniform(0, 2 * np.pi, (4, 3))
    size = random.uniform(0.1, 0.25, (4, 3))
    waves = np.sin(2 * np.pi * time_s[:, None, None] * frequency + phase)
    begin = np.clip(time_s, 0.0, 1.0)[:, None]
    return np.asarray((waves * size).sum(axis=1) * begin)


@numba.njit(cache=True)
def _run(sent, matrix, spring):  # type: ignore[no-untyped-def]
    n = len(sent)
    p = sent[0].copy()
    w = np.zeros(3)
    drum, current, contact = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    inertia, gain = RATIO * RATIO * ROTOR_KG_M2, RATIO * TORQUE_N_M_A
    h = 1.0 / RATE_HZ / SUBSTEPS
    turned = np.ascontiguousarray(matrix.T)
    for k in range(n):
        last = sent[max(k - 1, 0)]
        asked = KP * (sent[k] - p) + KD * ((sent[k] - last) * RATE_HZ - w)
        i = np.clip(asked / gain, -LIMIT_A, LIMIT_A)
        drum[k], current[k] = p, i
        contact[k] = spring * np.maximum(matrix @ p, 0.0)
        for _ in range(SUBSTEPS):
            load = turned @ (spring * np.maximum(matrix @ p, 0.0))
            drag = COULOMB_N_M * np.tanh(w / SMEAR_RAD_S) + DAMPING_N_M_S_RAD * w
            w = w + h / inertia * (gain * i - drag - load)
            p = p + h * w
    return drum, current, contact
