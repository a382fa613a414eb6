"""A reading as the other sensors tell it, for effects that could fit the noise of that reading.

What a reading was a moment ago, less what it is now, is its noise as much as its motion: an effect
made of that takes the noise of a regressor out of the residual and is found on data that lack
nothing. So the search makes such columns from the reading's projection on motion and on the other
torque sensors (two-stage least squares): their noise is not in the residual.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from estimation.derived import measured_channels
from estimation.diagnosis.candidate import Candidate, projected
from estimation.diagnosis.design import Run
from estimation.diagnosis.least_squares import least_squares
from estimation.effects.roles import CABLE_ANGLE, CABLE_LOAD, MOTOR_LOAD
from estimation.recording import FloatArray

SPEED, ACCELERATION, ANGLE = (
    "motor_velocity_rad_s",
    "motor_acceleration_rad_s2",
    "motor_angle_rad",
)
NOMINAL = {
    MOTOR_LOAD: "motor_current_a",
    CABLE_LOAD: "distal_torque_n_m",
    CABLE_ANGLE: "distal_torque_n_m",
}
"""Channels that stand for the target of their balance by nominal numbers, and the force they are
made from. A search takes the target as that force and the motion tell it on this rig; as other
forces tell it, it would hold what the balance lacks."""

FORCES = ("motor_current_a", "proximal_torque_n_m", "distal_torque_n_m")

Fit = tuple[tuple[str, ...], FloatArray]
"""The torques and the current a projection uses, and the weights of all its columns."""

WIDTHS_RAD_S = (1.0, 5.0)
"""Widths of the smooth signs that stand for friction at a reversal."""


def instruments(measured: Collection[str]) -> list[str]:
    """Return the channels a projection is made from; none where the motor is not measured."""
    if ANGLE not in measured:
        return []
    return [SPEED, ACCELERATION, ANGLE, *(name for name in FORCES if name in measured)]


def projection(runs: Sequence[Run], pool: Sequence[Candidate], target: str) -> Callable[[Run], Run]:
    """Return what adds to a run's channels those that the candidates want projected.

    Args:
        runs: Runs the projection is fitted on, with the channels of `instruments`.
        pool: The candidates.
        target: The balance's target, which is no instrument.
    """
    wanted = {name for c in pool for role, name in c.channels if role in c.effect.projected_roles}
    fits = {name: fit for name in sorted(wanted) if (fit := fitted(runs, name, target))}

    def added(run: Run) -> Run:
        new = {projected(name): as_told(run, fit) for name, fit in fits.items()}
        return replace(run, channels={**run.channels, **new})

    return added


def stand_in(runs: Sequence[Run], target: str) -> Callable[[Run], Run]:
    """Return what puts the target, as its own force tells it on this rig, in a nominal one's place.

    Args:
        runs: Runs it is fitted on, with the channels of `instruments`.
        target: The balance's target.
    """
    nominal = next((n for n in NOMINAL if n in runs[0].channels), None)
    fit = fitted(runs, target, target, NOMINAL[nominal]) if nominal else None
    if nominal is None or fit is None:
        return lambda run: run
    level = _level(runs, fit, target)

    def put(run: Run) -> Run:
        return replace(run, channels={**run.channels, nominal: as_told(run, fit) + level})

    return put


def _level(runs: Sequence[Run], load: Fit, target: str) -> float:
    """Return how much higher the target is than its projection, which has no zero of its own."""
    above = [(run.channels[target] - as_told(run, load))[run.kept] for run in runs]
    return float(np.mean(np.concatenate(above)))


def as_told(run: Run, fit: Fit) -> FloatArray:
    """Return a channel of a run as the other sensors tell it, shape (n,)."""
    forces, weights = fit
    return instrument_columns(run.channels, forces) @ weights


def fitted(runs: Sequence[Run], name: str, target: str, force: str | None = None) -> Fit | None:
    """Fit a channel's projection; None where there is nothing to project it on.

    In place of a nominal load, which is off by the friction that is looked for, the target is
    projected, on what that load is not made from.

    Args:
        runs: Runs with the channels of `instruments`.
        name: The channel.
        target: The balance's target, which is no instrument.
        force: The only force to project on; None for all that are neither channel nor target.
    """
    there = set.intersection(*(set(run.channels) for run in runs))
    own = {name, *measured_channels([name]), target}
    forces = tuple(f for f in FORCES if f in there and f not in own and force in (f, None))
    if not {SPEED, ACCELERATION, ANGLE} <= there or not forces:
        return None
    columns, aims = [], []
    for run in runs:
        aim = run.channels[target if name in NOMINAL else name]
        table = np.column_stack([instrument_columns(run.channels, forces), aim])[run.kept]
        table -= table.mean(axis=0)
        columns.append(table[:, :-1])
        aims.append(table[:, -1])
    return forces, least_squares(np.vstack(columns), np.concatenate(aims))


def instrument_columns(channels: Mapping[str, FloatArray], forces: Sequence[str]) -> FloatArray:
    """Return motion, friction and the forces, shape (n, columns)."""
    speed, angle = channels[SPEED], channels[ANGLE]
    signs = [np.tanh(speed / width) for width in WIDTHS_RAD_S]
    motion = [speed, channels[ACCELERATION], angle, angle**2, *signs, signs[-1] * angle]
    loads = [channels[force] for force in forces]
    return np.column_stack([*motion, *loads, *(np.abs(load) * signs[-1] for load in loads)])
