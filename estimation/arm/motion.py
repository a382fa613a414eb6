"""Motion and torque of an arm's joints out of a recording, filtered alike."""

from dataclasses import dataclass

import numpy as np

from estimation.arm.kinematics import ArmError
from estimation.filters import LowPass, zero_phase
from estimation.recording import FloatArray, Recording

LOW_PASS = LowPass(cutoff_hz=5.0, order=3)
"""The thesis' filter at its data's rate: order 3, 0.1 of half of 100 Hz."""

FINE = LowPass(cutoff_hz=20.0, order=3)
"""Filter of the motion that columns are made from before they are filtered as the torque is."""


@dataclass(frozen=True, slots=True)
class JointNames:
    """The channels of one joint, numbered from 1."""

    number: int
    prismatic: bool

    def _named(self, angular: str, linear: str) -> str:
        return f"joint_{self.number}_{linear if self.prismatic else angular}"

    @property
    def position(self) -> str:
        """Its angle or position."""
        return self._named("angle_rad", "position_m")

    @property
    def velocity(self) -> str:
        """Its velocity."""
        return self._named("velocity_rad_s", "velocity_m_s")

    @property
    def acceleration(self) -> str:
        """Its acceleration, derived."""
        return self._named("acceleration_rad_s2", "acceleration_m_s2")

    @property
    def torque(self) -> str:
        """Its torque or force."""
        return self._named("torque_n_m", "force_n")

    @property
    def links(self) -> str:
        """What the arm's links need of it, computed."""
        return self._named("links_torque_n_m", "links_force_n")

    def links_correction(self, number: int) -> str:
        """Return the torque of a change of the links' parameters, computed."""
        return self._named(f"links_{number}_torque_n_m", f"links_{number}_force_n")

    @property
    def direction(self) -> str:
        """Its smooth sign of velocity, computed before the torque's filter."""
        return f"joint_{self.number}_direction_ratio"

    def drive(self, number: int) -> str:
        """Return the computed angle of a motor behind a coupling that acts on this joint."""
        return f"joint_{self.number}_drive_{number}_angle_rad"


@dataclass(frozen=True)
class Motion:
    """Joint motion, shape (n, joints) each; rad and N m, or m and N where prismatic."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    period_s: float

    def __len__(self) -> int:
        return len(self.position)


def joint_names(recording: Recording) -> list[JointNames]:
    """Return the channels of a recording's joints, numbered from 1; none where it holds no arm."""
    found: list[JointNames] = []
    while True:
        both = [JointNames(len(found) + 1, prismatic) for prismatic in (False, True)]
        there = [names for names in both if names.position in recording.columns]
        if not there:
            return found
        found.append(there[0])


def joint_channels(recording: Recording) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return positions, velocities and torques of a recording's joints, shape (n, joints) each.

    Joints are numbered from 1; revolute ones have `joint_<i>_angle_rad`, prismatic ones
    `joint_<i>_position_m`, and their velocity and torque channels.

    Raises:
        ArmError: The recording has no joint 1.
        MissingChannelError: A joint lacks one of its three channels.
    """
    blocks = [
        [recording[name] for name in (names.position, names.velocity, names.torque)]
        for names in joint_names(recording)
    ]
    if not blocks:
        raise ArmError(
            f"Run {recording.name!r} holds no arm joints.",
            "Channels such as joint_1_angle_rad were expected.",
        )
    position, velocity, torque = np.array(blocks).transpose(1, 2, 0)
    return position, velocity, torque


def motion_of(position: FloatArray, period_s: float, low_pass: LowPass = LOW_PASS) -> Motion:
    """Filter positions, shape (n, joints), forwards and backwards and differentiate them twice.

    Velocity comes from the positions, not from a velocity channel, so that position, velocity and
    acceleration are of one motion.
    """
    smooth = zero_phase(position, 1 / period_s, low_pass)
    velocity = np.gradient(smooth, period_s, axis=0)
    return Motion(smooth, velocity, np.gradient(velocity, period_s, axis=0), period_s)


def periodic_motion(position: FloatArray, period_s: float, highest_hz: float) -> Motion:
    """Return a whole number of periods, differentiated in the frequency domain, up to a frequency.

    As E. del Sol et al. 2014 do it: bin k of a transform over P samples is multiplied by j 2 pi k
    f_s / P, k counting negative frequencies in the upper half. The paper's printed factor lacks the
    imaginary unit. The last position is one sample before the first again.

    Raises:
        ArmError: Too few samples, or the frequency is not within half the sample rate.
    """
    if len(position) < 4 or not 0 < highest_hz <= 0.5 / period_s:
        raise ArmError(
            f"{len(position)} samples cannot be differentiated up to {highest_hz:g} Hz.",
            f"At {1 / period_s:g} samples a second, frequencies reach {0.5 / period_s:g} Hz.",
        )
    frequency_hz = np.fft.rfftfreq(len(position), period_s)
    pulse = 2j * np.pi * frequency_hz[:, None]
    spectrum = np.fft.rfft(position, axis=0)
    spectrum[frequency_hz > highest_hz] = 0
    smooth, velocity, acceleration = (
        np.fft.irfft(spectrum * pulse**k, len(position), axis=0) for k in range(3)
    )
    return Motion(smooth, velocity, acceleration, period_s)
