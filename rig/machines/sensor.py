"""A device without motors where a rig has its logger: it is watched and recorded, never armed."""

from typing import Self

from rig.configuration.config import Config
from rig.machines.drive import rate_of, sampled_at
from rig.machines.machine import Machine


class SensorMachine(Machine):
    """A machine without motors."""

    def __init__(self, rate_hz: float) -> None:
        self.profile = sampled_at(rate_hz)

    @classmethod
    def of(cls, config: Config) -> Self:
        """Return the machine at the rate that the device is asked at."""
        return cls(rate_of(config))

    def at(self, rate_hz: float) -> Self:
        """Return the machine of a device with another rate."""
        return type(self)(rate_hz)
