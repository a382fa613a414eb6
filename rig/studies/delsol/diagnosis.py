"""What the diagnosis names on a simulated hydraulic arm that is moved freely.

The joints are torque equations of the project's own diagnosis, declared by the paper's model.
One run in three is held out before any fit; the reported gain of an effect is from those.
"""

from dataclasses import dataclass

import numpy as np

from estimation.arm.balances import equations
from estimation.arm.effects import on_joint
from estimation.arm.motion import JointNames, Motion
from estimation.arm.shared import laid_out
from estimation.causes.verdict import answer
from estimation.diagnosis.split import split
from estimation.model import Term
from estimation.recording import FloatArray, Recording
from rig.arm.simulated import recorded
from rig.studies.delsol.hydraulic_arm import (
    HYDRAULIC,
    RATE_HZ,
    HydraulicArm,
    free_motions,
    measured_torque,
)

PULLS = ("spring.position", "friction.position")
"""What the catalogue calls the pull and the rub of hoses or wires."""

JOINTS = len(HYDRAULIC.joints)
NAMES = tuple(JointNames(k + 1, prismatic=False) for k in range(JOINTS))


@dataclass(frozen=True)
class Named:
    """One finding of the diagnosis.

    Attributes:
        joint: The joint, from 1.
        family: Its name in the catalogue; `unknown` where it is not named.
        verdict: What is claimed.
        alternatives: Names that it could have as well.
        before_n_m: RMS error on the runs set aside before it, after what was found earlier, N m.
        after_n_m: The same with it, N m.
    """

    joint: int
    family: str
    verdict: str
    alternatives: tuple[str, ...]
    before_n_m: float
    after_n_m: float


Effects = tuple[tuple[int, Term], ...]
"""Effects found, each with its joint, from 0."""


def diagnosed(arm: HydraulicArm, rng: np.random.Generator) -> tuple[tuple[Named, ...], Effects]:
    """Move an arm freely and diagnose its joints; return the result and its effects."""
    recordings = free_runs(arm, rng)
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


def free_runs(arm: HydraulicArm, rng: np.random.Generator) -> list[Recording]:
    """Return runs of all joints along finite Fourier series (equation 14), each about a pose."""
    runs = []
    for number, motion in enumerate(free_motions(rng)):
        torque = measured_torque(arm, motion, np.zeros((len(motion), 3)), rng)
        runs.append(recorded(f"free {number}", motion.position, torque, RATE_HZ))
    return runs


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
