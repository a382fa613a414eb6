"""A simulated hydraulic arm with a tie bar, as del Sol et al. 2014 used; its geometry is assumed.

The paper publishes no dimensions but the horizontal reach of 1.289 m. Hidden from every model: hose
drag on joint 1, friction with memory (Dahl) or a drawn family of the same size (`rig.arm.hidden`),
pressure noise, errors of the pressure constants.
"""

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from estimation.arm.motion import Motion, periodic_motion
from estimation.arm.regressor import regressor
from estimation.arm.tables import Arm, Body, DhRow, Joint
from estimation.arm.wrench import tip_jacobians
from estimation.recording import FloatArray
from rig.arm.hidden import OWN, HiddenTorque, bouc_wen, draw_hidden

RATE_HZ = 50.0
RUNS, SECONDS = 18, 40.0
HARMONICS = 5
FUNDAMENTALS = (1, 2, 3)
"""Periods of a run's lowest harmonic; the runs alternate, so that a spring, proportional to
position, is not collinear with inertia, proportional to position times frequency squared."""

HIGHEST_HZ = 5.0

SPEED_RAD_S = 2.0
"""Frictions change sign over half a per cent of it."""

_BODIES = (
    Body("shoulder azimuth", 0, DhRow(0.0, 0.0, 0.3, 0.0), (1, 0, 0, 0, 0)),
    Body("shoulder elevation", 1, DhRow(0.0, pi / 2, 0.0, 0.3), (0, 1, 0, 0, 0)),
    Body("elbow", 2, DhRow(0.5, 0.0, 0.0, -0.6), (0, 0, 1, 0, 0)),
    Body("wrist pitch", 3, DhRow(0.45, 0.0, 0.0, 0.2), (0, 0, 0, 1, 0)),
    Body("wrist yaw", 4, DhRow(0.1, pi / 2, 0.0, 0.0), (0, 0, 0, 0, 1)),
    Body("held axis", 5, DhRow(0.1, -pi / 2, 0.0, 0.0), (0, 0, 0, 0, 0)),
    Body("coupling", 1, DhRow(0.0, pi / 2, 0.0, -0.3), (0, 1, 1, 0, 0)),
    Body("tie bar", 7, DhRow(0.12, 0.0, 0.0, 0.6), (0, 0, -1, 0, 0)),
)
REACH = (0.9, 0.5, 0.6, 0.7, 0.8)
"""Half the range of each actuated joint around zero, rad."""

HYDRAULIC = Arm(
    name="hydraulic manipulator with tie bar",
    joints=tuple(
        Joint(body.name, "revolute", body.row, -reach, reach, SPEED_RAD_S)
        for body, reach in zip(_BODIES, REACH, strict=False)
    ),
    tip=DhRow(0.139, 0.0, 0.0, 0.0),
    tip_body=6,
    viscous_pairs=(),
    gravity_m_s2=(0.0, 0.0, -9.80665),
    loops=_BODIES,
    hydraulic=True,
    source="E. del Sol et al. 2014: reach and tie bar; every other dimension and mass is assumed",
)

MASS_KG = np.array([20.0, 12.0, 8.0, 3.0, 2.0, 1.0, 1.0, 3.0])
LENGTH_M = np.array([0.1, 0.5, 0.45, 0.1, 0.1, 0.14, 0.12, 0.5])
COULOMB_N_M = np.array([5.0, 6.0, 4.0, 2.0, 1.0, 0.0, 0.3, 0.3])
VISCOUS_N_M_S = np.array([6.0, 8.0, 5.0, 2.0, 1.0, 0.0, 0.5, 0.5])

HIDDEN_N_M = np.array([3.0, 29.0, 19.0, 28.0, 11.0])
"""Amplitude of the hidden friction, set so that the paper's method meets its table 2."""

PRESSURE_NOISE_N_M = np.array([0.8, 5.0, 2.0, 3.3, 1.1])
SLIP_RAD = 0.12
HOSE_N_M_RAD = 4.5
CONSTANT_ERROR = 0.04
SPREAD = 0.2


@dataclass(frozen=True)
class HydraulicArm:
    """One arm drawn at random around the plausible one."""

    values: FloatArray  # parameters in the order of `estimation.arm.regressor.names`
    hidden: FloatArray  # amplitude of hidden friction of each actuated joint, N m
    hose: float  # stiffness of the hoses on joint 1, N m/rad
    constants: FloatArray  # true over nominal pressure constant of each actuated joint
    # hidden torque of a drawn family, in place of the friction with memory
    form: HiddenTorque | None = None


def draw(rng: np.random.Generator, family: str = OWN) -> HydraulicArm:
    """Draw an arm, whose hidden friction is of a family of `rig.arm.hidden`."""

    def around(values: FloatArray) -> FloatArray:
        return values * np.exp(SPREAD * rng.normal(size=values.shape))

    mass, length = around(MASS_KG), LENGTH_M
    zero = np.zeros_like(mass)
    first = mass * length / 2
    inertia = mass * length**2 / 3
    thin = 0.05 * inertia
    links = np.column_stack([mass, first, zero, zero, thin, zero, inertia, zero, zero, inertia])
    values = np.concatenate([links.ravel(), around(COULOMB_N_M), around(VISCOUS_N_M_S)])
    constants = 1 + CONSTANT_ERROR * rng.normal(size=5)
    arm = HydraulicArm(values, around(HIDDEN_N_M), float(around(np.array(HOSE_N_M_RAD))), constants)
    if family == OWN:
        return arm
    motion = free_motions(rng)[0]
    return replace(
        arm, form=draw_hidden(family, rng, motion, np.std(friction(arm, motion), axis=0))
    )


def free_motions(rng: np.random.Generator) -> list[Motion]:
    """Return motions of all joints along finite Fourier series (equation 14), about poses."""
    time = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    reach = np.array(REACH)
    motions = []
    for number in range(RUNS):
        slowest = FUNDAMENTALS[number % len(FUNDAMENTALS)] / SECONDS
        phase = 2 * np.pi * slowest * np.outer(time, np.arange(1, HARMONICS + 1))
        sine, cosine = rng.normal(size=(2, HARMONICS, len(reach)))
        wave = np.sin(phase) @ sine + np.cos(phase) @ cosine
        share = rng.uniform(0.5, 0.9, len(reach))
        pose = 0.9 * (1 - share) * rng.uniform(-1, 1, len(reach))
        position = reach * (pose + share * wave / np.abs(wave).max(axis=0))
        motions.append(periodic_motion(position, 1 / RATE_HZ, HIGHEST_HZ))
    return motions


def friction(arm: HydraulicArm, motion: Motion) -> FloatArray:
    """Return the hidden friction along a motion, shape (n, joints)."""
    if arm.form is not None:
        return arm.form(motion)
    return arm.hidden * bouc_wen(motion.position, np.full(5, SLIP_RAD))


def measured_torque(
    arm: HydraulicArm, motion: Motion, force: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return the torque that the pressures show of a motion, with a force at the tip (n, 3)."""
    inner = regressor(HYDRAULIC, motion) @ arm.values
    jacobians = tip_jacobians(HYDRAULIC, motion.position)[:, :3]
    outer = np.einsum("nij,ni->nj", jacobians, force)
    hidden = friction(arm, motion)
    turn = motion.position[:, 0]
    hidden[:, 0] += arm.hose * turn * (1 + turn**2)  # hoses pull harder the further they bend
    noise = PRESSURE_NOISE_N_M * rng.normal(size=inner.shape)
    return np.asarray((inner + outer + hidden) / arm.constants + noise)
