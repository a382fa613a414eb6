"""The torque equations of an arm's joints for a diagnosis: `joint.N`, declared by the arm's model.

The links' torque has parameters that all joints share (`estimation.arm.shared`). The terms of one
joint (friction, spring, drive inertia, offset) are declared in its equation, so that they are
fitted again together with every candidate.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation.arm.base import base_of, closed_base_of
from estimation.arm.closed_chain import FRICTION, ClosedChain, closed_regressor, parameter_names
from estimation.arm.motion import LOW_PASS, JointNames, Motion, joint_names
from estimation.arm.regressor import SIGN_WIDTH, regressor
from estimation.arm.regressor import names as serial_names
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
    """The torque equations of an arm's joints.

    Attributes:
        name: The arm.
        models: Declared model of each joint, without values.
        joints: Channels of each joint.
        columns: Motion to the columns of the declared parameters, shape (n, joints, parameters).
        shared: Of each parameter, whether it is the links' and not a joint's own.
        sign_width: Speed over which each joint's Coulomb friction changes sign, shape (joints,).
        motors: Positions of a wrist's joints to those of its motors, or None; see `wrist`.
        wrist: First joint, from 0, that motors behind a coupling drive.
    """

    name: str
    models: tuple[Model, ...]
    joints: tuple[JointNames, ...]
    columns: Columns
    shared: NDArray[np.bool_]
    sign_width: FloatArray
    motors: FloatArray | None = None
    wrist: int = 0


def balances_of(recording: Recording) -> ArmBalances | None:
    """Return the equations of the arm whose joints a recording contains; None for an unknown arm.

    The joints' kinds decide; joints beyond the arm's own, such as a gripper's, may follow.
    """
    prismatic = [names.prismatic for names in joint_names(recording)]
    for arm in ARMS:
        kinds = [joint.kind == "prismatic" for joint in arm.joints]
        if prismatic[: len(kinds)] == kinds:
            return serial(arm, recording)
    return None


def declared_arm(models: Sequence[Model], recordings: Sequence[Recording]) -> ArmBalances | None:
    """Return the equations of the arm whose joints are declared; None where none is, or no run."""
    of_joints = any(model.balance.startswith("joint.") for model in models)
    return balances_of(recordings[0]) if of_joints and recordings else None


def serial(arm: Arm, recording: Recording) -> ArmBalances:
    """Return the torque equations of a serial arm.

    Args:
        arm: The arm.
        recording: Any of its recordings, for the channels' names.
    """
    names, base = joint_names(recording), base_of(arm)
    shared = np.array([not serial_names(arm)[k].startswith(OWN) for k in base.columns])

    def columns(motion: Motion) -> FloatArray:
        return regressor(arm, motion)[:, :, base.columns]

    changes = _changes(columns, shared, len(arm.joints))
    models = []
    for k, joint in enumerate(arm.joints):
        own = names[k]
        terms = _of_every_joint(own, changes[k])
        if joint.spring:
            terms.append(Term(effect("spring.position"), channels={"position": own.position}))
        terms += [
            Term(effect("friction.viscous"), channels={"speed": names[other].velocity})
            for row, other in arm.viscous_pairs
            if row == k
        ]
        models.append(_model(own, terms, f"{arm.name}; {arm.source}"))
    count = len(arm.wrist_coupling)
    coupled = arm.wrist is not None and len(names) >= arm.wrist + count
    return ArmBalances(
        arm.name,
        tuple(models),
        tuple(names[: len(arm.joints)]),
        columns,
        shared,
        SIGN_WIDTH * np.array([joint.speed for joint in arm.joints]),
        motors=np.linalg.inv(np.array(arm.wrist_coupling)) if coupled else None,
        wrist=arm.wrist or 0,
    )


def closed(chain: ClosedChain, sign_rad_s: float) -> ArmBalances:
    """Return the torque equations of a pressure-driven arm with closed loops.

    Its first bodies are those of the actuated joints: their frictions belong to the joints, those
    of the loops' bodies are shared. Pressures have a true zero, so runs have no separate offsets.

    Args:
        chain: The arm.
        sign_rad_s: Speed over which Coulomb friction changes sign.
    """
    names = tuple(JointNames(k + 1, prismatic=False) for k in range(chain.closure.shape[1]))
    own = {f"{kind}{joint.number}" for kind in FRICTION for joint in names}
    base = closed_base_of(chain, sign_rad_s)
    shared = np.array([parameter_names(chain)[k] not in own for k in base.columns])

    def columns(motion: Motion) -> FloatArray:
        return closed_regressor(chain, motion, sign_rad_s)[:, :, base.columns]

    changes = _changes(columns, shared, len(names))
    models = [
        replace(
            _model(joint, _of_every_joint(joint, count), f"{chain.name}; {chain.source}"),
            run_offsets=False,
        )
        for joint, count in zip(names, changes, strict=True)
    ]
    return ArmBalances(
        chain.name, tuple(models), names, columns, shared, np.full(len(names), sign_rad_s)
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


def _model(own: JointNames, terms: Sequence[Term], description: str) -> Model:
    return Model(
        name=f"joint {own.number}",
        balance=f"joint.{own.number}",
        target=own.torque,
        terms=(*terms, Term(effect("sensor.offset"))),
        description=description,
        low_pass=LOW_PASS,
    )
