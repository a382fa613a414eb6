"""Effects an arm's torque may hold beyond the thesis' model, each as columns by name.

The rows of the columns are the arm's joints and, where cables couple a gripper to the wrist, the
gripper: the wrist carries the load of its motor, so its torque improves the identification.

Hysteresis is a sum of elastic-slip elements (Maxwell slip): each follows the motion until its
spring slips, so with the thresholds fixed it is linear in its strengths. F. Al-Bender, V. Lampaert,
J. Swevers, "The generalized Maxwell-slip model", IEEE T-AC 50(11), 2005.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numba import njit
from scipy import signal

from estimation.arm.motion import Motion
from estimation.arm.tables import Arm, Joint
from estimation.recording import FloatArray

JOINT_SLIP_SHARE = (0.002, 0.006, 0.02)
"""Thresholds of a joint's slip elements, as shares of half its range."""

SIGN_SHARE = 0.005
"""Share of a joint's top speed over which its friction changes sign."""

STRIBECK_SHARE = 0.03
"""Share of a joint's top speed above which its friction has fallen."""

CREEP_S = (0.2, 1.0)
"""Time constants of creeping cables and belts."""

TRACK_KNOTS = 20
"""Knots of a friction that changes along a joint's track: tight spots of a tenth of its range."""

TRACK_OVERHANG = 0.5
"""Shares of the range that the knots reach beyond it: arms are driven past their table's range."""

RIPPLE_ORDERS = (8, 12, 16, 20, 24, 32)
"""Periods of a ripple tried in 2 pi rad of a revolute joint: gear and motor orders are unknown."""

TRACK_DAMPING = 100.0
"""Factor on the common damping: most of a track's knots are rarely visited."""


@dataclass(frozen=True)
class ArmEffect:
    """One effect on a joint, as further columns of the torque regressor."""

    name: str
    what: str  # description in one line
    columns: Callable[[Motion], FloatArray]  # columns along a motion, shape (n, rows, parameters)
    dissipative: bool = False  # whether physics forbids negative parameters
    damping: float = 1.0  # how many times the common damping its fit gets


def row_count(arm: Arm) -> int:
    """Return the number of rows of the columns: joints, and the gripper if cables couple it."""
    return max(len(arm.joints), (arm.wrist or 0) + len(arm.wrist_coupling))


def of_joints(arm: Arm) -> list[ArmEffect]:
    """Return the effects worth trying on every joint before the wrist, and between them."""
    before_wrist = len(arm.joints) if arm.wrist is None else arm.wrist
    found = [effect for k in range(before_wrist) for effect in _of_joint(arm, k)]
    for k in range(min(3, before_wrist)):
        for other in range(min(3, before_wrist)):
            if other != k:
                found += _pulls(arm, k, other)
    return found


def _of_joint(arm: Arm, k: int) -> list[ArmEffect]:
    joint = arm.joints[k]
    name, effect = joint.name, partial(_effect, arm, k)
    return [
        effect(
            "presliding",
            f"elastic slip in the {name}",
            lambda m: _slips(m.position[:, [k]], joint),
            dissipative=True,
        ),
        effect(
            "Stribeck friction",
            f"friction of the {name} that falls with speed",
            lambda m: [_sign(m, k, joint) * _slow(m, k, joint)],
            dissipative=True,
        ),
        effect(
            "curved spring",
            f"elastic torque of the {name} in square and cube of position",
            lambda m: [m.position[:, k] ** p for p in (2, 3)],
        ),
        effect(
            "uneven spring",
            f"elastic torque of the {name} that swings four times a turn (prismatic: range)",
            lambda m: _four_a_turn(m.position[:, k], joint),
        ),
        effect(
            "curved friction",
            f"friction of the {name} in the signed square of speed",
            lambda m: [m.velocity[:, k] * np.abs(m.velocity[:, k])],
        ),
        effect(
            "one-sided friction",
            f"friction of the {name} that differs with direction",
            lambda m: [np.abs(_sign(m, k, joint)), np.abs(m.velocity[:, k])],
        ),
        effect(
            "friction by position",
            f"Coulomb friction of the {name} that changes along its range",
            lambda m: [_sign(m, k, joint) * m.position[:, k] ** p for p in (1, 2)],
        ),
        effect(
            "friction along the track",
            f"tight and loose spots of the {name}: Coulomb friction, linear between knots",
            lambda m: [_sign(m, k, joint)[:, None] * _track(m.position[:, k], joint)],
            damping=TRACK_DAMPING,
        ),
        effect(
            "late torque",
            f"a delay between motion and torque of the {name}",
            lambda m: [np.gradient(m.acceleration[:, k], m.period_s)],
        ),
        *_repeated(arm, k),
    ]


Columns = Callable[[Motion], list[FloatArray]]


def _effect(arm: Arm, k: int, kind: str, what: str, values: Columns, **more: Any) -> ArmEffect:
    def on(motion: Motion) -> FloatArray:
        return on_joint(np.column_stack(values(motion)), k, row_count(arm))

    return ArmEffect(f"{kind} J{k + 1}", what, on, **more)


def _repeated(arm: Arm, k: int) -> list[ArmEffect]:
    """Return the effects of a joint that are tried at several times or orders."""
    joint, effect = arm.joints[k], partial(_effect, arm, k)
    name = joint.name

    def creeping(time: float) -> Columns:
        return lambda m: [creep(m.velocity[:, k], time, m.period_s)]

    def swinging(order: int) -> Columns:
        return lambda m: _swing(order * m.position[:, k])

    damper = f"a damper behind a spring in the {name}"
    effects = [
        effect(f"creep {time:g} s", damper, creeping(time), dissipative=True) for time in CREEP_S
    ]
    ripple = f"torque ripple or eccentric gear of the {name}"
    if joint.kind == "revolute":
        effects += [
            effect(f"ripple {order} a turn", ripple, swinging(order)) for order in RIPPLE_ORDERS
        ]
    return effects


def _pulls(arm: Arm, k: int, other: int) -> list[ArmEffect]:
    def on(values: Callable[[FloatArray], FloatArray]) -> Callable[[Motion], FloatArray]:
        return lambda m: on_joint(values(m.position[:, [other]]), k, row_count(arm))

    return [
        ArmEffect(
            f"cable pull J{other + 1} on J{k + 1}",
            "elastic torque on one joint by the position of another",
            on(lambda q: q),
        ),
        ArmEffect(
            f"squared cable pull J{other + 1} on J{k + 1}",
            "elastic torque on one joint by the square of another's position",
            on(lambda q: q**2),
        ),
    ]


def on_joint(values: FloatArray, joint: int, rows: int) -> FloatArray:
    """Return columns acting on one joint: (n, k) to (n, rows, k)."""
    columns = np.zeros((len(values), rows, values.shape[1]))
    columns[:, joint] = values
    return columns


def _slips(position: FloatArray, joint: Joint) -> list[FloatArray]:
    half = (joint.upper - joint.lower) / 2
    return [slip(position, share * half)[:, 0] for share in JOINT_SLIP_SHARE]


def _sign(motion: Motion, k: int, joint: Joint) -> FloatArray:
    return np.tanh(motion.velocity[:, k] / (SIGN_SHARE * joint.speed))


def _slow(motion: Motion, k: int, joint: Joint) -> FloatArray:
    return np.exp(-((motion.velocity[:, k] / (STRIBECK_SHARE * joint.speed)) ** 2))


def _track(position: FloatArray, joint: Joint) -> FloatArray:
    over = TRACK_OVERHANG * (joint.upper - joint.lower)
    return hats(position, joint.lower - over, joint.upper + over, TRACK_KNOTS)


def _four_a_turn(position: FloatArray, joint: Joint) -> list[FloatArray]:
    turn = 2 * np.pi if joint.kind == "revolute" else joint.upper - joint.lower
    return _swing(4 * (2 * np.pi / turn) * position)


def _swing(phase: FloatArray) -> list[FloatArray]:
    return [np.sin(phase), np.cos(phase)]


def slip(position: FloatArray, threshold: float) -> FloatArray:
    """Return the deflection of elastic-slip elements, relative to that at which they slip.

    Positions are of shape (n, drives), the threshold is in their unit. The elements start relaxed,
    so what they give is history-free only after each has slipped once.
    """
    return np.asarray(_stretch(np.ascontiguousarray(position), threshold) / threshold)


@njit(cache=True)
def _stretch(position, threshold):  # type: ignore[no-untyped-def]
    stretch = np.zeros_like(position)
    for k in range(1, len(position)):
        for j in range(position.shape[1]):
            moved = stretch[k - 1, j] + position[k, j] - position[k - 1, j]
            stretch[k, j] = min(max(moved, -threshold), threshold)
    return stretch


def creep(velocity: FloatArray, time_constant_s: float, period_s: float) -> FloatArray:
    """Return the velocity of a damper in series with a spring (a Maxwell element), 0 at the start.

    Its time constant is damping over stiffness; the velocity is of shape (n, ...).
    """
    kept = np.exp(-period_s / time_constant_s)
    return signal.lfilter([1 - kept], [1, -kept], velocity, axis=0)


def hats(position: FloatArray, lower: float, upper: float, count: int) -> FloatArray:
    """Return a piecewise linear function's columns at positions (n,), shape (n, count).

    Its knots are evenly spaced from `lower` to `upper`; the ends go on flat.
    """
    knots = np.linspace(lower, upper, count)
    inside = np.clip(position, lower, upper)[:, None]
    return np.asarray(np.clip(1 - np.abs(inside - knots) / (knots[1] - knots[0]), 0, 1))
