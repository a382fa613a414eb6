"""Motion and torque of an arm's joints out of a recording, filtered alike."""

from dataclasses import dataclass

import numpy as np

from estimation.arm.kinematics import ArmError
from estimation.filters import LowPass, zero_phase
from estimation.recording import FloatArray, Recording

LOW_PASS = LowPass(cutoff_hz=5.0, order=3)
"""The thesis' filter at its data's rate: order 3, 0.1 of half of 100 Hz."""

_REVOLUTE = ("angle_rad", "velocity_rad_s", "torque_n_m")
_PRISMATIC = ("position_m", "velocity_m_s", "force_n")


@dataclass(frozen=True)
class Motion:
    """Joint motion, shape (n, joints) each; rad and N m, or m and N where prismatic.

    Attributes:
        position: Positions.
        velocity: Velocities.
        acceleration: Accelerations.
        period_s: Sample period, s.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    period_s: float

    def __len__(self) -> int:
        return len(self.position)


def joint_channels(recording: Recording) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return positions, velocities and torques of a recording's joints, shape (n, joints) each.

    Joints are numbered from 1; revolute ones have `joint_<i>_angle_rad`, prismatic ones
    `joint_<i>_position_m`, and their velocity and torque channels.

    Raises:
        ArmError: There is no joint 1.
        MissingChannelError: A joint lacks one of its three channels.
    """
    blocks = []
    for joint in range(1, len(recording.columns) + 1):
        for units in (_REVOLUTE, _PRISMATIC):
            if f"joint_{joint}_{units[0]}" in recording.columns:
                blocks.append([recording[f"joint_{joint}_{unit}"] for unit in units])
                break
        else:
            break
    if not blocks:
        raise ArmError(
            f"Run {recording.name!r} holds no arm joints.",
            "Channels such as joint_1_angle_rad were expected.",
        )
    position, velocity, torque = np.array(blocks).transpose(1, 2, 0)
    return position, velocity, torque


def motion_of(position: FloatArray, period_s: float, low_pass: LowPass = LOW_PASS) -> Motion:
    """Filter positions and differentiate them twice.

    Velocity comes from the positions, not from a velocity channel, so that position, velocity and
    acceleration are of one motion.

    Args:
        position: Measured joint positions, shape (n, joints).
        period_s: Sample period, s.
        low_pass: Filter, run forwards and backwards.
    """
    smooth = zero_phase(position, 1 / period_s, low_pass)
    velocity = np.gradient(smooth, period_s, axis=0)
    return Motion(smooth, velocity, np.gradient(velocity, period_s, axis=0), period_s)
