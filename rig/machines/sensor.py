"""A device without motors where a rig has its logger: it is watched and recorded, never armed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn, Self

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from drivers.teensy.profile import ArmLimits
from drivers.teensy.protocol import Trip
from rig.configuration.config import Config
from rig.errors import UsageError
from rig.log.streams import COUNTS_STREAM
from rig.machines.drive import rate_of, sampled_at
from rig.machines.machine import FloatArray, MachinePlan


@dataclass(frozen=True)
class Observation:
    """A run in which nothing moves.

    Attributes:
        last: Samples of the run.
        first: Index of its first.
    """

    last: int
    first: int = 0

    @property
    def setpoints(self) -> tuple[FloatArray, ...]:
        """Nothing is asked for; one column that has the run's length."""
        return (np.zeros(self.last),)


class SensorMachine:
    """Implements `rig.machines.machine.Machine`.

    Args:
        rate_hz: Samples a second.
    """

    counts = COUNTS_STREAM
    setpoint_channels: tuple[str, ...] = ()
    channels_of_inputs: Mapping[str, str] = {}
    here_channels: tuple[str, ...] = ()
    shown: tuple[str, ...] = ()

    def __init__(self, rate_hz: float) -> None:
        self.profile = sampled_at(rate_hz)

    @classmethod
    def of(cls, config: Config) -> Self:
        """Return the machine at the rate that the device is asked at."""
        return cls(rate_of(config))

    def at(self, rate_hz: float) -> Self:
        """Return the machine of a device with another rate."""
        return type(self)(rate_hz)

    def first_look(self, config: Config) -> str:
        """Return the protocol in which nothing moves."""
        return "still"

    def here(self, columns: Mapping[str, FloatArray]) -> tuple[float, ...]:
        """Return nothing: it has no place."""
        return ()

    def motion(self, plan: MachinePlan, here: tuple[float, ...]) -> Observation:
        """Return a run as long as the plan's."""
        return Observation(round(plan.duration_s * self.profile.rate_hz))

    def settling(self, here: tuple[float, ...]) -> Observation:
        """Return a run without samples."""
        return Observation(0)

    def gains(self, config: Config) -> Sequence[Any]:
        """Refuse: it has no motors."""
        self._refuse(config.logger.driver)

    def board_limits(self, config: Config, calibrations: CalibrationSet) -> ArmLimits:
        """Refuse: it has no motors."""
        self._refuse(config.logger.driver)

    def reference_counts(
        self, config: Config, calibrations: CalibrationSet, here: Sequence[float]
    ) -> tuple[int, ...]:
        """Refuse: it has no encoders that a limit depends on."""
        self._refuse(config.logger.driver)

    def check_setpoints(self, config: Config, setpoints: Sequence[FloatArray]) -> None:
        """Refuse: it has no motors."""
        self._refuse(config.logger.driver)

    def too_narrow(self, limits: ArmLimits, sample: np.void) -> tuple[ArmLimits, Trip]:
        """Refuse: it has no motors."""
        self._refuse("device")

    def beyond(self, limits: ArmLimits) -> tuple[NDArray[np.integer], ...]:
        """Refuse: it has no motors."""
        self._refuse("device")

    def untroubled(self, limits: ArmLimits) -> ArmLimits:
        """Refuse: it has no motors."""
        self._refuse("device")

    def _refuse(self, name: str) -> NoReturn:
        raise UsageError(
            f"A {name} has no motor that could be armed, moved or stopped.",
            'The configuration has [logger] profile = "sensor".',
            "Use `rig live` or `rig record` with it.",
        )
