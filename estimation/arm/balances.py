"""The torque equations of an arm's joints for a diagnosis: `joint.N`, declared by the arm's model.

The links' torque has parameters that all joints share (`estimation.arm.shared`). The terms of one
joint (friction, spring, drive inertia, offset) are declared in its equation, so that they are
fitted again together with every candidate.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.arm.base import base_of
from estimation.arm.motion import LOW_PASS, JointNames, Motion, joint_names
from estimation.arm.regressor import FRICTION, regressor, sign_width
from estimation.arm.regressor import names as parameters
from estimation.arm.tables import PSM, Arm
from estimation.effects import effect
from estimation.model import Model, Term
from estimation.recording import FloatArray, Recording

ARMS = (PSM,)
"""Arms that recordings may be of."""

CORRECTIONS = 3
"""Corrections of the links' parameters that each joint's equation fits with every candidate."""

OWN = ("F", "Ke", "Ia", "tau0")
"""Prefixes of the names of parameters that belong to one joint and are declared in its equation."""


SAMPLES = 300
"""Random samples that determine how many corrections of the links are identifiable at a joint."""

Columns = Callable[[Motion], FloatArray]


@dataclass(frozen=True)
class ArmBalances:
    """The torque equations of an arm's joints."""

    name: str  # the arm
    models: tuple[Model, ...]  # declared, of each joint, without values
    joints: tuple[JointNames, ...]  # channels of each joint
    columns: Columns  # of the declared parameters, shape (n, joints, parameters)
    shared: NDArray[np.bool_]  # of each parameter, whether it is the links' and not a joint's own
    sign_width: FloatArray  # speed over which Coulomb friction changes sign, (joints,)
    motors: FloatArray | None = None  # positions of a wrist's joints to its motors'; see `wrist`
    wrist: int = 0  # first joint, from 0, that motors behind a coupling drive


def balances_of(recording: Recording) -> ArmBalances | None:
    """Return the equations of the arm whose joints a recording contains; None for an unknown arm.

    The joints' kinds decide; joints beyond the arm's own, such as a gripper's, may follow.
    """
    prismatic = [names.prismatic for names in joint_names(recording)]
    for arm in ARMS:
        kinds = [joint.kind == "prismatic" for joint in arm.joints]
        if prismatic[: len(kinds)] == kinds:
            return equations(arm, joint_names(recording))
    return None


def declared_arm(models: Sequence[Model], recordings: Sequence[Recording]) -> ArmBalances | None:
    """Return the equations of the arm whose joints are declared; None where none is, or no run."""
    of_joints = any(model.balance.startswith("joint.") for model in models)
    return balances_of(recordings[0]) if of_joints and recordings else None


def equations(arm: Arm, names: Sequence[JointNames]) -> ArmBalances:
    """Return the torque equations of an arm's joints; others, such as a gripper's, may follow them.

    Of a hydraulic arm the first bodies are those of the actuated joints: their frictions belong to
    the joints, those of the loops' bodies are shared.
    """
    base, joints = base_of(arm), names[: len(arm.joints)]
    frictions = tuple(f"{kind}{joint.number}" for kind in FRICTION for joint in joints)
    own = frictions if arm.hydraulic else OWN
    shared = np.array([not parameters(arm)[k].startswith(own) for k in base.columns])

    def columns(motion: Motion) -> FloatArray:
        return regressor(arm, motion)[:, :, base.columns]

    changes = _changes(columns, shared, len(joints))
    models = []
    for k, (joint, own_names) in enumerate(zip(arm.joints, joints, strict=True)):
        terms = _of_every_joint(own_names, changes[k])
        if joint.spring:
            terms.append(Term(effect("spring.position"), channels={"position": own_names.position}))
        terms += [
            Term(effect("friction.viscous"), channels={"speed": names[other].velocity})
            for row, other in arm.viscous_pairs
            if row == k
        ]
        models.append(
            Model(
                name=f"joint {own_names.number}",
                balance=f"joint.{own_names.number}",
                target=own_names.torque,
                terms=(*terms, Term(effect("sensor.offset"))),
                description=f"{arm.name}; {arm.source}",
                low_pass=LOW_PASS,
                run_offsets=not arm.hydraulic,
            )
        )
    count = len(arm.wrist_coupling)
    coupled = arm.wrist is not None and len(names) >= arm.wrist + count
    return ArmBalances(
        arm.name,
        tuple(models),
        tuple(joints),
        columns,
        shared,
        sign_width(arm),
        motors=np.linalg.inv(np.array(arm.wrist_coupling)) if coupled else None,
        wrist=arm.wrist or 0,
    )


def _of_every_joint(own: JointNames, changes: int) -> list[Term]:
    return [
        Term(effect("arm.links"), channels={"links": own.links}),
        *(
            Term(effect("arm.links.change"), channels={"change": own.links_correction(k + 1)})
            for k in range(changes)
        ),
        Term(effect("friction.viscous"), channels={"speed": own.velocity}),
        Term(effect("arm.friction"), channels={"direction": own.direction}),
        Term(effect("inertia.missing"), channels={"acceleration": own.acceleration}),
    ]


def _changes(columns: Columns, shared: NDArray[np.bool_], joints: int) -> list[int]:
    """Return how many corrections of the links are identifiable at each joint."""
    position, velocity, acceleration = np.random.default_rng(0).uniform(-1, 1, (3, SAMPLES, joints))
    table = columns(Motion(position, velocity, acceleration, 1.0))[:, :, shared]
    ranks = [int(np.linalg.matrix_rank(table[:, k])) for k in range(joints)]
    return [min(CORRECTIONS, max(rank - 1, 0)) for rank in ranks]
