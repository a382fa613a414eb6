"""A simulated patient-side manipulator of seven degrees of freedom: six joints and the gripper.

The arm's declared part is that of `rig.arm.simulated`. Its instrument's cables add what Zhang et
al. 2022 report: a coupling matrix that is not quite the nominal one, friction that remembers, and
vibration of the moving gripper. Joint torque is computed from the motors' torque with the nominal
matrix, A_nominal^-T A_true^T tau (`rig.grasper.coupling` has the erratum of the paper's equation
4).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import signal

from estimation.arm.motion import Motion
from estimation.arm.regressor import regressor
from estimation.arm.tables import PSM, Arm
from estimation.arm.wrench import spatial_jacobians
from estimation.recording import FloatArray
from rig.arm.hidden import HiddenTorque, bouc_wen
from rig.arm.simulated import HIDDEN_SHARE, SimulatedArm
from rig.grasper.dvrk import dvrk_coupling

RATE_HZ = 50.0
JOINTS = 7
GRIPPER = 6
WRIST = slice(3, 7)
"""Roll, pitch, yaw and gripper: what the instrument's four motors drive."""

MEMORY = np.array([0.9, 1.45, 0.72, 0.0, 0.0, 0.0])
"""Friction with memory of each joint, as a share of its declared torque's RMS."""

CABLE_N_M = np.array([0.00077, 0.019, 0.0132, 0.0132])
"""Friction with memory of the instrument's four motors and their cables."""

NOISE = np.array([0.05, 0.06, 0.1, 0.03, 0.03, 0.05])
"""Noise of the torque, white, as a share of the declared torque's RMS."""

PULL = np.array([0.0, 0.0, 4.0, 0.004])
"""Pull of the gripper's cables on joints 1 to 4: N m, N or N m a N m of the gripper."""

RUB = np.array([0.0, 0.0, 0.0, 0.011])
"""Rubbing of the moving gripper's cables in the shaft, N m or N."""

RUB_RAD_S = 0.1

VIBRATION = np.array([0.0, 0.0, 3.0, 0.006])
"""Ringing of joints 1 to 4 after the gripper turns back, N m or N."""

PRESS_N_M, CLOSED_RAD = 0.06, 0.02
"""Torque by which closed jaws press on one another, and the angle below which they begin to."""

RINGING_HZ, RINGING_S = 8.0, 0.03
COUPLING_ERROR = 0.12
"""Standard deviation of the true coupling matrix's elements, relative to the nominal ones."""

SPREAD = 0.15
"""Standard deviation of the logarithm of each strength between instruments."""

SLIP_SHARE = np.array([0.05, 0.05, 0.04, 0.02, 0.02, 0.02])
"""Motion over which a joint's friction turns, as a share of its range."""

CABLE_SLIP_RAD, GRIPPER_SLIP_RAD = 0.15, 0.15
NOISE_RAD, NOISE_RAD_S = 2e-5, 2e-3
"""Noise of positions and velocities; in m and m/s of the insertion."""

CHUNK = 8000
"""Samples whose regressor is held at once."""


@dataclass(frozen=True)
class Kind:
    """An instrument family as it is drawn around."""

    name: str
    model: str  # model number, by which its nominal coupling is known
    open_rad: float  # angle to which its gripper opens; closed is 0
    offset_n_m: float  # torque of the resting gripper
    spring_n_m_rad: float  # stiffness of the gripper's cables against opening
    friction_n_m: float  # friction of the gripper
    memory_n_m: float  # friction with memory of the gripper


KINDS = {
    "LND": Kind("Large Needle Driver", "400006", 1.0, 0.010, 0.02, 0.014, 0.016),
    "CF": Kind("Cadiere Forceps", "400049", 1.0, -0.021, 0.03, 0.011, 0.017),
    "LTF": Kind("Long Tip Forceps", "400048", 1.0, -0.028, 0.03, 0.010, 0.028),
    "MCS": Kind("Monopolar Curved Scissors", "400179", 1.0, -0.026, 0.03, 0.018, 0.018),
    "MBF": Kind("Maryland Bipolar Forceps", "400172", 1.0, -0.031, 0.03, 0.009, 0.034),
    "PF": Kind("ProGrasp Forceps", "400093", 1.0, -0.020, 0.03, 0.028, 0.010),
    "RF": Kind("Resano Forceps", "400181", 1.0, -0.023, 0.03, 0.012, 0.025),
    "SCA": Kind("Small Clip Applier", "400003", 0.7, -0.029, 0.03, 0.016, 0.018),
}
"""The paper's eight instruments. Jaw ranges beyond the dVRK's and all torques are assumed."""


@dataclass(frozen=True)
class Psm:
    """One arm with one instrument, drawn around the plausible ones."""

    arm: SimulatedArm  # the arm; its hidden strengths are not used but scale those here
    kind: Kind
    memory: FloatArray  # friction with memory of joints 1 to 6, N m or N
    cable_n_m: FloatArray  # friction with memory of the four motors and their cables
    noise: FloatArray  # standard deviation of the noise of each joint, N m or N
    true_coupling: FloatArray  # from motors to roll, pitch, yaw and gripper, shape (4, 4)
    leak: FloatArray  # A_nominal^-T A_true^T: torque shown by torque there is, shape (4, 4)
    # hidden torque of a drawn family, in place of friction with memory
    form: HiddenTorque | None = None

    @property
    def nominal_coupling(self) -> FloatArray:
        """From motors to roll, pitch, yaw and gripper as the dVRK states it, shape (4, 4)."""
        return dvrk_coupling(self.kind.model).jacobian

    @property
    def table(self) -> Arm:
        """The arm's table with the instrument's nominal coupling."""
        rows = self.nominal_coupling[1:, 1:]
        return replace(PSM, wrist_coupling=tuple(tuple(map(float, row)) for row in rows))


@dataclass(frozen=True)
class PsmRun:
    """The readings of the arm's sensors in a run."""

    position: FloatArray  # measured positions, shape (n, 7), rad or m
    velocity: FloatArray  # measured velocities, shape (n, 7)
    torque: FloatArray  # joint torques as the nominal coupling shows them, shape (n, 7), N m or N

    def __len__(self) -> int:
        return len(self.position)

    def part(self, start: int, stop: int) -> "PsmRun":
        """Return some of its samples."""
        kept = slice(start, stop)
        return PsmRun(self.position[kept], self.velocity[kept], self.torque[kept])


def with_instrument(rng: np.random.Generator, arm: SimulatedArm, name: str) -> Psm:
    """Draw an instrument of one of `KINDS` and put it on an arm."""
    kind = KINDS[name]
    scale = np.exp(SPREAD * rng.normal(size=8))
    drawn = replace(
        kind,
        offset_n_m=kind.offset_n_m * scale[0],
        spring_n_m_rad=kind.spring_n_m_rad * scale[1],
        friction_n_m=kind.friction_n_m * scale[2],
        memory_n_m=kind.memory_n_m * scale[3],
    )
    declared = arm.hidden[0] / HIDDEN_SHARE
    nominal = dvrk_coupling(kind.model).jacobian
    true = nominal * (1 + COUPLING_ERROR * rng.normal(size=(4, 4)))
    return Psm(
        arm=arm,
        kind=drawn,
        memory=MEMORY * declared,
        cable_n_m=CABLE_N_M * scale[4:],
        noise=np.append(NOISE * declared, 0.05 * kind.friction_n_m),
        true_coupling=true,
        leak=np.linalg.inv(nominal).T @ true.T,
    )


def simulate(
    psm: Psm,
    motion: Motion,
    rng: np.random.Generator,
    wrench: FloatArray | None = None,
    grip_n_m: FloatArray | None = None,
    lead: int = 0,
) -> PsmRun:
    """Return the readings of the sensors in a motion, shape (n, 7).

    The wrench is that of the tip on its surroundings, spatial, shape (n, 6); None in free space.
    `grip_n_m` is the torque of the gripper on an object, shape (n,). The first `lead` samples are
    discarded: they bring the cables to their initial state.
    """
    joints = np.zeros((len(motion), JOINTS))
    joints[:, :GRIPPER] = _declared(psm.arm.values, motion)
    if wrench is not None:
        jacobians = spatial_jacobians(PSM, motion.position[:, :GRIPPER])
        joints[:, :GRIPPER] += np.einsum("nij,ni->nj", jacobians, wrench)
    own = gripper_torque(psm.kind, motion.position[:, GRIPPER], motion.velocity[:, GRIPPER])
    joints[:, GRIPPER] = own if grip_n_m is None else own + grip_n_m
    shown = joints.copy()
    shown[:, WRIST] = joints[:, WRIST] @ psm.leak.T
    shown += psm.form(motion) if psm.form is not None else memory(psm, motion)
    shown[:, :4] += np.outer(joints[:, GRIPPER], PULL)
    shown[:, :4] += np.outer(np.tanh(motion.velocity[:, GRIPPER] / RUB_RAD_S), RUB)
    shown[:, :4] += np.outer(ringing(motion.velocity[:, GRIPPER], rng), VIBRATION)
    shown += psm.noise * rng.normal(size=shown.shape)
    position = motion.position + NOISE_RAD * rng.normal(size=shown.shape)
    velocity = motion.velocity + NOISE_RAD_S * rng.normal(size=shown.shape)
    return PsmRun(position, velocity, shown).part(lead, len(motion))


def gripper_torque(kind: Kind, position: FloatArray, velocity: FloatArray) -> FloatArray:
    """Return the torque that a gripper takes to move, N m; arrays of shape (n,).

    Where it is closed its jaws press on one another.
    """
    return (
        kind.offset_n_m
        + kind.spring_n_m_rad * position
        + kind.friction_n_m * np.tanh(velocity / RUB_RAD_S)
        + kind.memory_n_m * bouc_wen(position[:, None], np.array([GRIPPER_SLIP_RAD]))[:, 0]
        - PRESS_N_M * np.clip(1 - position / CLOSED_RAD, 0, 1)
    )


def ringing(velocity: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return a ringing that starts whenever a velocity, shape (n,), changes its sign."""
    turned = np.diff(np.sign(velocity), prepend=np.sign(velocity[0])) != 0
    strength = np.where(turned, rng.uniform(-1, 1, len(velocity)) ** 5, 0.0)
    pole = np.exp(-1 / (RINGING_S * RATE_HZ) + 2j * np.pi * RINGING_HZ / RATE_HZ)
    answer = signal.lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], strength)
    return np.asarray(answer, dtype=np.float64)


def memory(psm: Psm, motion: Motion) -> FloatArray:
    """Return the torque of friction with memory, of joints and of the motors' cables, (n, 7)."""
    shown = np.zeros((len(motion), JOINTS))
    lower, upper, _ = PSM.limits
    slips = SLIP_SHARE * (upper - lower)
    shown[:, :GRIPPER] = psm.memory * bouc_wen(motion.position[:, :GRIPPER], slips)
    motors = motion.position[:, WRIST] @ np.linalg.inv(psm.true_coupling).T
    friction = psm.cable_n_m * bouc_wen(motors, np.full(4, CABLE_SLIP_RAD))
    shown[:, WRIST] += friction @ np.linalg.inv(psm.nominal_coupling)
    return shown


def _declared(values: FloatArray, motion: Motion) -> FloatArray:
    parts = []
    for start in range(0, len(motion), CHUNK):
        kept = slice(start, start + CHUNK)
        part = Motion(
            motion.position[kept], motion.velocity[kept], motion.acceleration[kept], motion.period_s
        )
        parts.append(regressor(PSM, part) @ values)
    return np.concatenate(parts)
