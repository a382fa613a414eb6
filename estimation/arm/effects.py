"""Effects an arm's torque may hold beyond the thesis' model, each as columns by name.

Hysteresis is a sum of elastic-slip elements (Maxwell slip): each follows the motion until its
spring slips, so with the thresholds fixed it is linear in its strengths. F. Al-Bender, V. Lampaert,
J. Swevers, "The generalized Maxwell-slip model", IEEE T-AC 50(11), 2005.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np

from estimation.arm.motion import Motion
from estimation.arm.tables import Arm, Joint
from estimation.recording import FloatArray

DRIVE_SLIP_RAD = (0.003, 0.01, 0.03, 0.1, 0.3)
"""Thresholds of the wrist drives' elements: finer than their backlash up to a third of a turn."""

JOINT_SLIP_SHARE = (0.002, 0.006, 0.02)
"""Thresholds of a joint's elements, as shares of half its range."""

DRIVE_SIGN_RAD_S = 0.02


@dataclass(frozen=True)
class ArmEffect:
    """One effect, as further columns of the torque regressor.

    Attributes:
        name: What it is called, with its joint.
        what: What it is, in one line.
        columns: Columns along a motion, shape (n, joints, parameters).
    """

    name: str
    what: str
    columns: Callable[[Motion], FloatArray]


def candidates(arm: Arm) -> tuple[ArmEffect, ...]:
    """Return the effects worth trying on an arm, joint by joint."""
    found = [effect for k in range(len(arm.joints)) for effect in _of_joint(arm, k)]
    found += [_pull(arm, k, other) for k, other in ((0, 1), (1, 0), (2, 0), (2, 1))]
    return (*found, *_wrist(arm))


def _of_joint(arm: Arm, k: int) -> list[ArmEffect]:
    name = arm.joints[k].name
    return [
        ArmEffect(f"presliding J{k + 1}", f"elastic slip in the {name}", _presliding(arm, k)),
        ArmEffect(
            f"curved spring J{k + 1}",
            f"elastic torque of the {name} in square and cube of position",
            _on(arm, k, lambda m: [m.position[:, k] ** p for p in (2, 3)]),
        ),
        ArmEffect(
            f"uneven spring J{k + 1}",
            f"elastic torque of the {name} that swings four times a turn (prismatic: range)",
            _on(arm, k, lambda m: _four_a_turn(m.position[:, k], arm.joints[k])),
        ),
        ArmEffect(
            f"curved friction J{k + 1}",
            f"friction of the {name} in the signed square of speed",
            _on(arm, k, lambda m: [m.velocity[:, k] * np.abs(m.velocity[:, k])]),
        ),
        ArmEffect(
            f"friction by position J{k + 1}",
            f"Coulomb friction of the {name} that changes along its range",
            _on(arm, k, lambda m: _by_position(m, k, arm.joints[k].speed)),
        ),
    ]


def _pull(arm: Arm, k: int, other: int) -> ArmEffect:
    return ArmEffect(
        f"cable pull J{other + 1} on J{k + 1}",
        "elastic torque on one joint by the position of another",
        _on(arm, k, lambda m: [m.position[:, other]]),
    )


def _wrist(arm: Arm) -> list[ArmEffect]:
    if arm.wrist is None:
        return []
    first = arm.wrist
    return [
        ArmEffect(
            "wrist drive friction",
            "Coulomb friction of the wrist's motors, through the coupling",
            lambda m: _of_drives(arm, m, lambda q, v: [np.tanh(v / DRIVE_SIGN_RAD_S)]),
        ),
        ArmEffect(
            "wrist drive damping",
            "viscous friction of the wrist's motors, through the coupling",
            lambda m: _of_drives(arm, m, lambda q, v: [v]),
        ),
        ArmEffect(
            "wrist drive curved friction",
            "friction of the wrist's motors in the signed root of speed, through the coupling",
            lambda m: _of_drives(arm, m, lambda q, v: [np.sign(v) * np.sqrt(np.abs(v))]),
        ),
        ArmEffect(
            "wrist drive hysteresis",
            "elastic slip of the wrist's cables at their motors, through the coupling",
            lambda m: _of_drives(arm, m, lambda q, v: [slip(q, r) for r in DRIVE_SLIP_RAD]),
        ),
        ArmEffect(
            "wrist cable springs",
            "elastic torque of the wrist and the gripper on one another",
            lambda m: np.concatenate(
                [
                    on_joint(m.position[:, [i]], j, len(arm.joints))
                    for i in range(first, first + len(arm.wrist_coupling))
                    for j in range(first, len(arm.joints))
                ],
                axis=2,
            ),
        ),
        ArmEffect(
            "shaft twist on wrist",
            "elastic torque of the wrist by the roll that twists its cables",
            lambda m: np.concatenate(
                [
                    on_joint(m.position[:, [first - 1]], j, len(arm.joints))
                    for j in range(first, len(arm.joints))
                ],
                axis=2,
            ),
        ),
    ]


def on_joint(values: FloatArray, joint: int, joints: int) -> FloatArray:
    """Return columns acting on one joint: (n, k) to (n, joints, k)."""
    columns = np.zeros((len(values), joints, values.shape[1]))
    columns[:, joint] = values
    return columns


def slip(position: FloatArray, threshold: float) -> FloatArray:
    """Return the stretch of elastic-slip elements, as a share of the one at which they slip.

    Args:
        position: Shape (n, drives); the elements start relaxed, so what they give is history-free
            only after each has slipped once.
        threshold: Stretch at which they slip, in the unit of position.
    """
    stretch: FloatArray = _stretch(np.ascontiguousarray(position), threshold) / threshold
    return stretch


@numba.njit(cache=True)
def _stretch(position, threshold):  # type: ignore[no-untyped-def]
    stretch = np.zeros_like(position)
    for k in range(1, len(position)):
        for j in range(position.shape[1]):
            moved = stretch[k - 1, j] + position[k, j] - position[k - 1, j]
            stretch[k, j] = min(max(moved, -threshold), threshold)
    return stretch


def _presliding(arm: Arm, k: int) -> Callable[[Motion], FloatArray]:
    half = (arm.joints[k].upper - arm.joints[k].lower) / 2
    return _on(
        arm, k, lambda m: [slip(m.position[:, [k]], s * half)[:, 0] for s in JOINT_SLIP_SHARE]
    )


def _four_a_turn(position: FloatArray, joint: Joint) -> list[FloatArray]:
    turn = 2 * np.pi if joint.kind == "revolute" else joint.upper - joint.lower
    phase = 4 * (2 * np.pi / turn) * position
    return [np.sin(phase), np.cos(phase)]


def _by_position(motion: Motion, k: int, speed: float) -> list[FloatArray]:
    sign = np.tanh(motion.velocity[:, k] / (0.01 * speed))
    return [sign * motion.position[:, k], sign * motion.position[:, k] ** 2]


def _on(
    arm: Arm, joint: int, values: Callable[[Motion], list[FloatArray]]
) -> Callable[[Motion], FloatArray]:
    return lambda m: on_joint(np.column_stack(values(m)), joint, len(arm.joints))


def _of_drives(
    arm: Arm,
    motion: Motion,
    values: Callable[[FloatArray, FloatArray], list[FloatArray]],
) -> FloatArray:
    """Return columns of the wrist's motors, as torques on the joints they drive.

    q = M q_motor and equal power give tau = M^-T tau_motor.
    """
    first = arm.wrist or 0
    inverse = np.linalg.inv(np.array(arm.wrist_coupling))
    driven = slice(first, first + len(inverse))
    position, velocity = (x[:, driven] @ inverse.T for x in (motion.position, motion.velocity))
    held = len(arm.joints) - first  # the gripper's own torque is not looked at
    blocks = []
    for block in values(position, velocity):
        columns = np.zeros((len(motion), len(arm.joints), len(inverse)))
        columns[:, first:] = block[:, None, :] * inverse.T[:held]
        blocks.append(columns)
    return np.concatenate(blocks, axis=2)
