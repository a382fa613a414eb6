"""External forces of a hydraulic arm from its pressures: del Sol et al. 2014, on simulated arms.

Each arm has a hidden friction of one family; its joints swing one after another by single sinusoids
within the paper's frequencies (table 1); its closed-chain model is fitted by damped least squares
to motion differentiated in the frequency domain. Then an elastic impact and a sliding effort. Our
method fits the same points with the effects that the diagnosis identified on further runs of the
same arm.
"""

from dataclasses import dataclass

import numpy as np

from estimation.arm.balances import equations
from estimation.arm.effects import on_joint
from estimation.arm.identification import damped_around
from estimation.arm.motion import JointNames, Motion, periodic_motion
from estimation.arm.regressor import regressor
from estimation.arm.shared import laid_out
from estimation.arm.wrench import tip_jacobians
from estimation.causes.verdict import answer
from estimation.diagnosis.split import split
from estimation.filters import LowPass, zero_phase
from estimation.model import Term
from estimation.recording import FloatArray
from rig.arm.hidden import FAMILIES
from rig.arm.simulated import recorded
from rig.output.provenance import Provenance
from rig.studies.delsol.hydraulic_arm import (
    HIGHEST_HZ,
    HYDRAULIC,
    RATE_HZ,
    REACH,
    SECONDS,
    HydraulicArm,
    draw,
    free_motions,
    measured_torque,
)
from rig.studies.families import arm_of
from rig.studies.seeds import Keeper, kept_outcomes

SCHEMA = "rig.study.delsol/4"

JOINTS = len(HYDRAULIC.joints)
NAMES = tuple(JointNames(k + 1, prismatic=False) for k in range(JOINTS))
PULLS = ("spring.position", "friction.position")
"""What the catalogue calls the pull and the rub of hoses or wires."""

TABLE_1_HZ = ((0.031, 0.396), (0.100, 0.800), (0.064, 0.611), (0.101, 0.909), (0.102, 1.313))
TABLE_2_N_M = (2.671, 8.950, 4.483, 7.091, 2.483)
TABLE_5_N = (26.096, 6.814)
PEAK_PERCENT = 12.98
STIFFNESS_N_M = 5000.0
PEAK_N = 26.096 / 0.1298
"""Peak of the impact: what table 5 and the relative error of the text give together."""
SLIDING_N = 30.0
"""Friction of the rough foam; assumed."""

PAPER, DISCARDED = "paper's method", "the same, points above 100 discarded"
OURS = "with what was found"
LARGEST_CONDITION = 100.0
"""Equation 15: points whose own part of the observation matrix has a larger condition number go."""

SWINGS = 4
POSES = 2
DAMPING = 0.3
LOW_PASS = LowPass(cutoff_hz=5.0, order=3)


@dataclass(frozen=True)
class Outcome:
    """One seed's results by one method."""

    residual_n_m: tuple[float, ...]  # RMS residual of each joint on the points of the fit, N m
    impact_n: float  # RMS error of the vertical force of the impact, N
    impact_percent: float  # the same over the force's peak, %
    sliding_n: float  # RMS error of the sliding force, N


Effects = tuple[tuple[int, Term], ...]
"""Effects found, each with its joint, from 0."""


@dataclass(frozen=True)
class Named:
    """One finding of the diagnosis."""

    joint: int
    family: str  # its name in the catalogue; `unknown` where it is not named
    verdict: str
    alternatives: tuple[str, ...]
    # RMS error on the runs set aside before it, after what was found earlier, N m
    before_n_m: float
    after_n_m: float  # the same with it, N m


@dataclass(frozen=True)
class DelSolStudy:
    """Results of the study."""

    schema: str
    seeds: int  # arms of each family
    outcomes: dict[str, tuple[Outcome, ...]]  # by method, one an arm, in the order of their numbers
    named: tuple[tuple[Named, ...], ...]  # what the diagnosis named on each arm
    provenance: Provenance


@dataclass(frozen=True)
class Seed:
    """One arm's results by method, and what the diagnosis named on it."""

    outcomes: dict[str, Outcome]
    named: tuple[Named, ...]


def run(seeds: int, keeper: Keeper) -> DelSolStudy:
    """Do the study on so many arms of every family, from seed 0.

    Raises:
        OSError: The folder cannot be written.
    """
    done = kept_outcomes(Seed, one_arm, seeds * len(FAMILIES), SCHEMA, keeper)
    by_method = {m: tuple(seed.outcomes[m] for seed in done) for m in (PAPER, DISCARDED, OURS)}
    named = tuple(seed.named for seed in done)
    return DelSolStudy(SCHEMA, seeds, by_method, named, Provenance.now(0))


def one_arm(number: int) -> Seed:
    """Do one arm."""
    seed, family = arm_of(number)
    rng = np.random.default_rng([seed, 2014])
    arm = draw(rng, family)
    runs = [(m, measured_torque(arm, m, np.zeros((len(m), 3)), rng)) for m in swings(rng)]
    tests = {name: make(arm, rng) for name, make in (("impact", impact), ("sliding", sliding))}
    named, effects = diagnosed(arm, rng)

    def our_columns(motion: Motion) -> FloatArray:
        return np.concatenate([paper_columns(motion), found_columns(effects, motion)], axis=2)

    outcomes = {}
    ways = {PAPER: paper_columns, DISCARDED: paper_columns, OURS: our_columns}
    for method, columns_of in ways.items():
        table = np.concatenate([columns_of(motion) for motion, _ in runs])
        torque = np.concatenate([torque for _, torque in runs])
        if method == DISCARDED:
            kept = np.linalg.cond(table) <= LARGEST_CONDITION  # of each point's rows
            table, torque = table[kept], torque[kept]
        values = damped_around(table, torque, np.zeros(table.shape[2]), DAMPING)
        left = torque - table @ values
        errors = {}
        for name, (motion, seen, force) in tests.items():
            axis = 2 if name == "impact" else 1
            estimate = tip_force(motion, seen - columns_of(motion) @ values)[:, axis]
            truth = zero_phase(force, RATE_HZ, LOW_PASS)[:, axis]
            errors[name] = float(np.sqrt(np.mean((estimate - truth) ** 2)))
        peak = float(np.abs(tests["impact"][2]).max())
        outcomes[method] = Outcome(
            residual_n_m=tuple(map(float, np.sqrt(np.mean(left**2, axis=0)))),
            impact_n=errors["impact"],
            impact_percent=100 * errors["impact"] / peak,
            sliding_n=errors["sliding"],
        )
    return Seed(outcomes, named)


def diagnosed(arm: HydraulicArm, rng: np.random.Generator) -> tuple[tuple[Named, ...], Effects]:
    """Move an arm freely and diagnose its joints; return the result and its effects.

    The joints are torque equations of the project's own diagnosis, declared by the paper's model.
    One run in three is held out before any fit.
    """
    still = np.zeros((round(SECONDS * RATE_HZ), 3))
    recordings = [
        recorded(f"free {k}", motion.position, measured_torque(arm, motion, still, rng), RATE_HZ)
        for k, motion in enumerate(free_motions(rng))
    ]
    sealed = split(recordings)
    balances = equations(HYDRAULIC, NAMES)
    whole = laid_out(balances, recordings, sealed.discover)
    found = answer(whole, balances.models, sealed)
    told = tuple(
        Named(
            int(finding.balance.removeprefix("joint.")),
            finding.family,
            finding.verdict,
            finding.alternatives,
            finding.rmse_before,
            finding.rmse_after,
        )
        for finding in found.diagnosis.findings
    )
    declared = {model.balance: len(model.terms) for model in balances.models}
    joints = [f"joint.{name.number}" for name in NAMES]
    # a model that needs channels that a motion alone does not give is not used
    given = {c for name in NAMES for c in (name.position, name.velocity, name.acceleration)}
    effects = tuple(
        (joints.index(model.balance), term)
        for model in found.models
        for term in model.terms[declared[model.balance] :]
        if {*term.channels.values()} <= given
    )
    return told, effects


def found_columns(effects: Effects, motion: Motion) -> FloatArray:
    """Return the columns of effects found along a motion, shape (n, joints, columns)."""
    channels = {}
    for k, name in enumerate(NAMES):
        channels[name.position] = motion.position[:, k]
        channels[name.velocity] = motion.velocity[:, k]
        channels[name.acceleration] = motion.acceleration[:, k]
    parts = [
        on_joint(term.sign * term.columns(channels, term.numbers(term.effect.shape)), k, JOINTS)
        for k, term in effects
    ]
    return np.concatenate([np.zeros((len(motion), JOINTS, 0)), *parts], axis=2)


def swings(rng: np.random.Generator) -> list[Motion]:
    """Return single sinusoids of one joint after another, whole periods, within table 1."""
    motions = []
    for joint, (lowest, highest) in enumerate(TABLE_1_HZ):
        for frequency in np.geomspace(lowest, highest, SWINGS):
            for _ in range(POSES):
                samples = round(RATE_HZ / frequency)
                phase = 2 * np.pi * np.arange(2 * samples) / samples
                pose = np.array(REACH) * rng.uniform(-0.6, 0.6, JOINTS)
                position = np.tile(pose, (len(phase), 1))
                size = min(0.8 * REACH[joint], 1.2 / (2 * np.pi * frequency))
                position[:, joint] = size * np.sin(phase)
                motions.append(periodic_motion(position, 1 / RATE_HZ, HIGHEST_HZ))
    return motions


def impact(arm: HydraulicArm, rng: np.random.Generator) -> tuple[Motion, FloatArray, FloatArray]:
    """Return joint 2's up and down onto a spring: motion, torque shown, force on the spring."""
    pose = np.array([0.1, -0.2, -0.1, 0.2, 0.0]) + 0.05 * rng.normal(size=JOINTS)
    motion = _around(pose, 1, 0.12, 0.2)
    lever = float(np.abs(tip_jacobians(HYDRAULIC, pose[None])[0, 2, 1]))
    depth = lever * np.clip(pose[1] - motion.position[:, 1], 0, None)
    force = np.zeros((len(motion), 3))
    force[:, 2] = -STIFFNESS_N_M * np.clip(depth - depth.max() + PEAK_N / STIFFNESS_N_M, 0, None)
    return motion, measured_torque(arm, motion, force, rng), force


def sliding(arm: HydraulicArm, rng: np.random.Generator) -> tuple[Motion, FloatArray, FloatArray]:
    """Return joint 1's sweep over rough foam: motion, torque shown, force on the foam."""
    pose = np.array([0.0, -0.2, -0.1, 0.2, 0.0]) + 0.05 * rng.normal(size=JOINTS)
    motion = _around(pose, 0, 0.85, 0.1)
    force = np.zeros((len(motion), 3))
    force[:, 1] = SLIDING_N * np.tanh(motion.velocity[:, 0] / 0.02)
    return motion, measured_torque(arm, motion, force, rng), force


def _around(pose: FloatArray, joint: int, size_rad: float, frequency_hz: float) -> Motion:
    time = np.arange(round(30 * RATE_HZ)) / RATE_HZ
    position = np.tile(pose, (len(time), 1))
    position[:, joint] += size_rad * np.sin(2 * np.pi * frequency_hz * time)
    return periodic_motion(position, 1 / RATE_HZ, HIGHEST_HZ)


def paper_columns(motion: Motion) -> FloatArray:
    """Return the 96 columns of eight links, ten parameters and two frictions each."""
    return regressor(HYDRAULIC, motion)


def tip_force(motion: Motion, external: FloatArray) -> FloatArray:
    """Return the force at the tip by the pseudo-inverse of the transposed Jacobian, (n, 3).

    Six components are not observable with five joints: the tip is assumed to push and not to twist.
    """
    smooth = zero_phase(external, RATE_HZ, LOW_PASS)
    jacobians = tip_jacobians(HYDRAULIC, motion.position)[:, :3]
    inverse = np.linalg.pinv(jacobians.transpose(0, 2, 1))
    return np.asarray(np.einsum("nij,nj->ni", inverse, smooth))
