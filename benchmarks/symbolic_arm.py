"""The links' torque regressor of a serial arm in SymPy: the baseline of the arm's benchmark.

Recursive Newton-Euler with a symbol for every intermediate result, compiled by lambdify: what the
thesis' toolbox does (C. D. Sousa and R. Cortesao, SymPyBotics).
"""

from collections.abc import Callable
from typing import Any

import sympy

from estimation.arm.tables import Arm

UP = sympy.Matrix([0, 0, 1])


def compiled(arm: Arm) -> Callable[..., Any]:
    """Return a function of positions, velocities and accelerations: columns one after another."""
    joints = len(arm.joints)
    q, v, a = (sympy.symbols(f"{letter}:{joints}") for letter in "qva")
    steps: list[tuple[Any, Any]] = []
    outputs: list[Any] = []
    turns, levers = [], []
    spin, turning = sympy.zeros(3, 1), sympy.zeros(3, 1)
    rising = sympy.Matrix([0, 0, -arm.gravity_m_s2[2]])
    for k, joint in enumerate(arm.joints):
        moves = int(joint.kind == "revolute")
        tilt = sympy.rot_axis1(-_exact(joint.row.alpha_rad))
        turn = _named(tilt * sympy.rot_axis3(-_exact(joint.row.theta_rad) - moves * q[k]), steps)
        lever = sympy.Matrix([joint.row.a_m, 0, 0]) + tilt * UP * (
            joint.row.d_m + (1 - moves) * q[k]
        )
        inner = turning.cross(lever) + spin.cross(_named(spin.cross(lever), steps))
        rising = _named(turn.T * _named(rising + inner, steps), steps)
        spin, turning = _named(turn.T * spin, steps), _named(turn.T * turning, steps)
        own, push = UP * v[k], UP * a[k]
        if moves:
            turning = _named(turning + spin.cross(own) + push, steps)
            spin = _named(spin + own, steps)
        else:
            rising = _named(rising + 2 * spin.cross(own) + push, steps)
        turns.append(turn)
        levers.append(lever)
        for force, moment in _of_link(joint.link == "full", spin, turning, rising):
            outputs += _column(arm, k, force, moment, turns, levers, steps)
    return sympy.lambdify([*q, *v, *a], outputs, "math", cse=lambda found: (steps, found))


def _exact(angle: float) -> Any:
    return sympy.nsimplify(angle / sympy.pi.evalf(), rational=True, tolerance=1e-9) * sympy.pi


def _named(expression: Any, steps: list[tuple[Any, Any]]) -> Any:
    """Give every entry a name of its own: without it, expressions double at every link."""
    named = expression.as_mutable()
    for k, entry in enumerate(expression):
        if not entry.is_Atom:
            steps.append((sympy.Symbol(f"x{len(steps)}"), entry))
            named[k] = steps[-1][0]
    return named


def _of_link(full: bool, spin: Any, turning: Any, rising: Any) -> list[tuple[Any, Any]]:
    """Return force and moment of each of a link's parameters, in Pinocchio's order."""
    nothing, axes = sympy.zeros(3, 1), [sympy.eye(3)[:, k] for k in range(3)]
    first = [(turning.cross(e) + spin.cross(spin.cross(e)), e.cross(rising)) for e in axes]
    if not full:
        return first
    second = []
    for row, column in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)):
        inertia = sympy.zeros(3, 3)
        inertia[row, column] = inertia[column, row] = 1
        second.append((nothing, inertia * turning + spin.cross(inertia * spin)))
    return [(rising, nothing), *first, *second]


def _column(
    arm: Arm,
    link: int,
    force: Any,
    moment: Any,
    turns: list[Any],
    levers: list[Any],
    steps: list[tuple[Any, Any]],
) -> list[Any]:
    """Return the torques of all joints by a force and a moment on a link."""
    column = [sympy.Integer(0)] * len(arm.joints)
    for k in range(link, -1, -1):
        column[k] = (moment if arm.joints[k].kind == "revolute" else force)[2]
        force = _named(turns[k] * _named(force, steps), steps)
        moment = _named(turns[k] * _named(moment, steps) + levers[k].cross(force), steps)
    return column
