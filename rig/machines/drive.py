"""One drive that this computer controls: the reference rig's machine at the drive's own rate.

The drive's shaft counts as motor and as spindle. It has no load motor.
"""

import math
from dataclasses import replace
from typing import Self

from drivers.registry import driver
from drivers.teensy.reference import REFERENCE
from rig.configuration.config import Config
from rig.errors import UsageError
from rig.machines.machine import Machine
from rig.machines.reference import ReferenceMachine
from rig.protocols.motion import Motion
from rig.protocols.protocol import Plan
from rig.protocols.trajectory import SAMPLE_RATE_HZ


class DeviceMachine(Machine):
    """A machine with any device in the logger's place, at the rate of that."""

    def __init__(self, rate_hz: float) -> None:
        self.profile = replace(REFERENCE, sampled_hz=rate_hz)  # with the tick of its core

    @classmethod
    def of(cls, config: Config) -> Self:
        """Return the machine at the rate its device is asked at; 1000 Hz where that has none.

        A fake is opened without options.

        Raises:
            UnknownDriverError: The driver is not installed, or does not load.
        """
        section = config.logger
        asked = {} if config.is_simulated else section.options
        options = {**driver(section.driver).options, **asked}
        return cls(float(options.get("rate_hz", SAMPLE_RATE_HZ)))

    def at(self, rate_hz: float) -> Self:
        """Return the machine of a device with another rate."""
        return type(self)(rate_hz)


class DriveMachine(DeviceMachine, ReferenceMachine):
    """A drive in place of the reference rig's motor and spindle.

    Its samples a second divide 1000, the rate of the trajectories.
    """

    shown = ("motor_current_a", "spindle_angle_rad")

    def __init__(self, rate_hz: float) -> None:
        every = SAMPLE_RATE_HZ / rate_hz
        if every < 1 or not every.is_integer():
            raise UsageError(
                f"A drive cannot be sampled at {rate_hz:g} Hz here.",
                f"Trajectories have {SAMPLE_RATE_HZ:g} samples a second, of which each sample of"
                " the drive takes one.",
                "Write a rate_hz that divides 1000, such as 50, 100, 125, 200, 250 or 500.",
            )
        super().__init__(rate_hz)
        self._every = int(every)

    def first_look(self, config: Config) -> str:
        """Return the protocol without load."""
        return "unloaded"

    def motion(self, plan: Plan, here: tuple[float, ...]) -> Motion:
        """Return approach, run and release, at the drive's rate."""
        return self._taken(super().motion(plan, here))

    def settling(self, here: tuple[float, ...]) -> Motion:
        """Return a little motion, at the drive's rate."""
        return self._taken(super().settling(here))

    def _taken(self, motion: Motion) -> Motion:
        setpoints = tuple(column[:: self._every] for column in motion.setpoints)
        first, last = (math.ceil(index / self._every) for index in (motion.first, motion.last))
        return Motion(setpoints, first, last)
