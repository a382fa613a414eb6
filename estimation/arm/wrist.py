"""Effects of a wrist that cables drive from motors behind a coupling, gripper included.

A motor's torque acts on the joints by q = M q_motor and equal power: tau = M^-T tau_motor.
"""

from collections.abc import Callable

import numpy as np

from estimation.arm.effects import ArmEffect, creep, of_joints, on_joint, row_count, slip
from estimation.arm.motion import Motion
from estimation.arm.tables import Arm
from estimation.recording import FloatArray

SLIP_RAD = (0.003, 0.01, 0.03, 0.1, 0.3)
"""Thresholds of slip elements: finer than the drives' backlash up to a third of a turn."""

SIGN_RAD_S = 0.02
"""Speed over which a motor's friction changes sign."""

GRIPPER_SIGN_RAD_S = 0.025

STRIBECK_RAD_S = 0.1

CREEP_S = 0.8

Values = Callable[[FloatArray, FloatArray, Motion], list[FloatArray]]
"""Torques of the three motors by their positions and velocities, (n, 3) each."""


def candidates(arm: Arm) -> tuple[ArmEffect, ...]:
    """Return all effects worth trying on an arm, joint by joint, then the wrist's."""
    return (*of_joints(arm), *of_wrist(arm))


def gripper(arm: Arm, motion: Motion) -> FloatArray:
    """Return the columns of the gripper's own offset, inertia, viscous and Coulomb friction.

    Shape (n, rows, 4), the last two columns being frictions; no columns without a gripper.
    """
    rows = row_count(arm)
    if rows == len(arm.joints):
        return np.zeros((len(motion), rows, 0))
    velocity, acceleration = (x[:, rows - 1] for x in (motion.velocity, motion.acceleration))
    sign = np.tanh(velocity / GRIPPER_SIGN_RAD_S)
    own = np.column_stack([np.ones(len(motion)), acceleration, velocity, sign])
    return on_joint(own, rows - 1, rows)


def of_wrist(arm: Arm) -> list[ArmEffect]:
    """Return the effects worth trying on a wrist behind a coupling."""
    return [] if arm.wrist is None else [*_of_drives(arm), *_of_roll(arm), *_of_cables(arm)]


def _of_drives(arm: Arm) -> list[ArmEffect]:
    def drives(name: str, what: str, values: Values) -> ArmEffect:
        return ArmEffect(
            f"wrist drive {name}",
            f"{what} of the wrist's motors, through the coupling",
            lambda m: through_coupling(arm, m, values),
            dissipative=True,
        )

    return [
        drives("friction", "Coulomb friction", lambda q, v, m: [_sign(v)]),
        drives("damping", "viscous friction", lambda q, v, m: [v]),
        drives(
            "curved friction",
            "friction in the signed root of speed",
            lambda q, v, m: [np.sign(v) * np.sqrt(np.abs(v))],
        ),
        drives(
            "Stribeck friction",
            "friction that falls with speed",
            lambda q, v, m: [_sign(v) * np.exp(-((v / STRIBECK_RAD_S) ** 2))],
        ),
        drives("hysteresis", "elastic slip", lambda q, v, m: [slip(q, r) for r in SLIP_RAD]),
        drives(
            "creep", "a damper behind a spring", lambda q, v, m: [creep(v, CREEP_S, m.period_s)]
        ),
        drives("inertia", "inertia", lambda q, v, m: [np.gradient(v, m.period_s, axis=0)]),
    ]


def _of_roll(arm: Arm) -> list[ArmEffect]:
    first = arm.wrist or 0
    roll = arm.joints[first - 1]

    def twist(m: Motion) -> FloatArray:
        return np.abs(m.position[:, [first - 1]]) / roll.upper

    return [
        ArmEffect(
            "wrist drive friction by roll",
            "Coulomb friction of the wrist's motors, as the roll twists their cables",
            lambda m: through_coupling(arm, m, lambda q, v, m: [_sign(v) * twist(m)]),
            dissipative=True,
        ),
        ArmEffect(
            "wrist drive hysteresis by roll",
            "elastic slip of the wrist's cables, as the roll twists them",
            lambda m: through_coupling(arm, m, lambda q, v, m: [slip(q, 0.1) * twist(m)]),
            dissipative=True,
        ),
        ArmEffect(
            "shaft twist on wrist",
            "elastic torque of the wrist by the roll that twists its cables",
            lambda m: _on_each(arm, m.position[:, [first - 1]]),
        ),
    ]


def _of_cables(arm: Arm) -> list[ArmEffect]:
    first, rows = arm.wrist or 0, row_count(arm)
    driven = range(first, rows)
    prismatic = [k for k, joint in enumerate(arm.joints) if joint.kind == "prismatic"]
    own = [
        ArmEffect(
            f"cable slip J{k + 1}",
            "elastic slip at one joint of the wrist, beyond its motors'",
            lambda m, k=k: on_joint(  # type: ignore[misc]
                np.column_stack([slip(m.position[:, [k]], r)[:, 0] for r in SLIP_RAD]), k, rows
            ),
            dissipative=True,
        )
        for k in driven
    ]
    return [
        *own,
        ArmEffect(
            "wrist springs",
            "elastic torque of each joint of the wrist by its own position",
            lambda m: np.concatenate(
                [on_joint(m.position[:, [k]], k, rows) for k in range(first, len(arm.joints))],
                axis=2,
            ),
        ),
        ArmEffect(
            "wrist cable springs",
            "elastic torque of the wrist and the gripper on one another",
            lambda m: np.concatenate([_on_each(arm, m.position[:, [k]]) for k in driven], axis=2),
        ),
        ArmEffect(
            "carriage on wrist",
            "inertia of the wrist's drives on the insertion's carriage",
            lambda m: np.concatenate(
                [_on_each(arm, m.acceleration[:, [k]]) for k in prismatic], axis=2
            ),
        ),
    ]


def through_coupling(arm: Arm, motion: Motion, values: Values) -> FloatArray:
    """Return columns of the wrist's motors, as torques on the joints they drive, gripper included.

    Shape (n, rows, motors x values), of the torques per parameter of each motor.
    """
    first = arm.wrist or 0
    inverse = np.linalg.inv(np.array(arm.wrist_coupling))
    driven = slice(first, first + len(inverse))
    position, velocity = (x[:, driven] @ inverse.T for x in (motion.position, motion.velocity))
    blocks = []
    for block in values(position, velocity, motion):
        columns = np.zeros((len(motion), row_count(arm), len(inverse)))
        columns[:, driven] = block[:, None, :] * inverse.T
        blocks.append(columns)
    return np.concatenate(blocks, axis=2)


def _on_each(arm: Arm, values: FloatArray) -> FloatArray:
    rows = row_count(arm)
    return np.concatenate([on_joint(values, k, rows) for k in range(arm.wrist or 0, rows)], axis=2)


def _sign(velocity: FloatArray) -> FloatArray:
    return np.tanh(velocity / SIGN_RAD_S)
