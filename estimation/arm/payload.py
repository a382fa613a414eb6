"""A mass added to an arm, from the residual torque of a model without it.

The mass is a point fixed to one link, at a known height along the link's axis and an unknown small
distance from it. Its torque is linear in the mass and, to first order, in mass times distance.
"""

from dataclasses import dataclass

import numpy as np

from estimation.arm.kinematics import ArmError
from estimation.arm.motion import Motion
from estimation.arm.recursion import LINK
from estimation.arm.regressor import names, regressor
from estimation.arm.tables import Arm
from estimation.recording import FloatArray

SIDE_STEP_M = 0.01
"""Step of the derivative by the distance from the axis, m."""

LEAST_PERIODS = 3


@dataclass(frozen=True)
class AddedMass:
    """An added mass with what is known of its error."""

    mass_kg: float
    by_joint_kg: tuple[float, ...]  # from each joint's torque alone
    from_periods_kg: float  # standard error from the scatter over periods of the motion
    from_joints_kg: float  # half the difference between the joints: what the model lacks
    from_lever_kg: float  # what one standard error of the height does

    @property
    def interval_kg(self) -> tuple[float, float]:
        """Two combined standard errors to either side."""
        half = 2 * float(
            np.sqrt(self.from_periods_kg**2 + self.from_joints_kg**2 + self.from_lever_kg**2)
        )
        return self.mass_kg - half, self.mass_kg + half


def point_mass(arm: Arm, motion: Motion, link: int, point_m: FloatArray) -> FloatArray:
    """Return the joint torques of one kilogram at a point of a link, shape (n, joints).

    The point is in the frame of the link, which counts from 1, m.

    Raises:
        ArmError: Not all of the link's parameters count.
    """
    every = names(arm)
    if f"m{link}" not in every:
        raise ArmError(f"Link {link} of {arm.name} has no mass of its own to add to.")
    x, y, z = point_m
    inertia = (y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y)
    values = dict(zip(LINK, (1.0, x, y, z, *inertia), strict=True))
    table = regressor(arm, motion)
    torque: FloatArray = sum(
        (value * table[:, :, every.index(f"{name}{link}")] for name, value in values.items()),
        np.zeros(table.shape[:2]),
    )
    return torque


def carried_torque(arm: Arm, motion: Motion) -> FloatArray:
    """Return the joint torques of what an arm carries, shape (n, joints); zero where it is nothing.

    An arm identified without its payload or with another tool estimates its torque with this added.

    Raises:
        ArmError: A mass sits on a link whose parameters do not all count.
    """
    torque = np.zeros((len(motion), len(arm.joints)))
    for mass in arm.carried:
        torque += mass.mass_kg * point_mass(arm, motion, mass.link, np.array(mass.point_m))
    return torque


def added_mass(
    residual: FloatArray,
    unit: tuple[FloatArray, FloatArray, FloatArray],
    taller: FloatArray,
    noise: FloatArray,
    samples_a_period: int,
) -> AddedMass:
    """Estimate an added mass.

    Args:
        residual: Residual torque of the model, shape (n, joints).
        unit: Torque of one kilogram on the axis, and its change by a step to either side; each of
            shape (n, joints).
        taller: Torque of one kilogram one standard error of the height further out.
        noise: RMS of the residual without the mass, shape (joints,).
        samples_a_period: Samples of one period of the motion.

    Raises:
        ArmError: The run has fewer than three periods.
    """
    joints = residual.shape[1]
    periods = len(residual) // samples_a_period
    if periods < LEAST_PERIODS:
        raise ArmError(
            f"The run holds {periods} whole periods of its motion.",
            f"The scatter over periods needs {LEAST_PERIODS}.",
        )

    def mass(rows: slice, own: FloatArray, which: list[int]) -> float:
        offsets = np.broadcast_to(np.eye(joints), (len(residual), joints, joints))
        columns = np.concatenate([np.stack([own, *unit[1:]], axis=2), offsets], axis=2)
        weighted = (columns / noise[:, None])[rows][:, which].reshape(-1, columns.shape[2])
        target = (residual / noise)[rows][:, which].ravel()
        return float(np.linalg.lstsq(weighted, target, rcond=None)[0][0])

    whole, every = slice(None), list(range(joints))
    value = mass(whole, unit[0], every)
    each = [
        mass(slice(k * samples_a_period, (k + 1) * samples_a_period), unit[0], every)
        for k in range(periods)
    ]
    alone = tuple(mass(whole, unit[0], [k]) for k in every)
    return AddedMass(
        mass_kg=value,
        by_joint_kg=alone,
        from_periods_kg=float(np.std(each, ddof=1) / np.sqrt(periods)),
        from_joints_kg=(max(alone) - min(alone)) / 2,
        from_lever_kg=abs(mass(whole, taller, every) - value),
    )
