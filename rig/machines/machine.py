"""The interface of a machine to a session, the same for every kind of rig."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from drivers.teensy.profile import ArmLimits, Profile
from drivers.teensy.protocol import Trip
from rig.configuration.config import Config
from rig.log.schema import Stream

FloatArray = NDArray[np.float64]


class MachinePlan(Protocol):
    """One run to be made."""

    @property
    def name(self) -> str:
        """Name of the run, unique in its protocol."""

    @property
    def conditions(self) -> dict[str, float | str]:
        """The constant conditions of the run."""

    @property
    def samples(self) -> int:
        """Samples the run will have."""

    @property
    def duration_s(self) -> float:
        """Length of the run, s."""


class MachineMotion(Protocol):
    """Setpoints of a whole motion: approach, the run, release."""

    @property
    def setpoints(self) -> tuple[FloatArray, ...]:
        """What is asked for, one array of shape (n,) for each field of a setpoint, SI units."""

    @property
    def first(self) -> int:
        """Index of the run's first setpoint."""

    @property
    def last(self) -> int:
        """Index behind its last."""


class Machine(Protocol):
    """One kind of rig.

    Attributes:
        profile: Samples and motors of its board.
        counts: Stream of its raw counts in a log.
        setpoint_channels: Channel whose calibration makes counts of each field of a setpoint.
        channels_of_inputs: Channel of each input of the board.
        here_channels: Channels whose values say where it stands, in the order of its setpoints.
        shown: Channels the live display shows, the main one first.
    """

    @classmethod
    def of(cls, config: Config) -> Self:
        """Return the machine of a configuration."""
        ...

    def at(self, rate_hz: float) -> Self:
        """Return the machine with the rate that its device really has."""
        ...

    @property
    def profile(self) -> Profile: ...  # noqa: D102
    @property
    def counts(self) -> Stream: ...  # noqa: D102
    @property
    def setpoint_channels(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def channels_of_inputs(self) -> Mapping[str, str]: ...  # noqa: D102
    @property
    def here_channels(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def shown(self) -> tuple[str, ...]: ...  # noqa: D102

    def first_look(self, config: Config) -> str:
        """Return the shipped protocol for a quick check of this rig."""
        ...

    def gains(self, config: Config) -> Sequence[Any]:
        """Return the gains of every controller, as `TeensyLogger.arm` takes them."""
        ...

    def board_limits(self, config: Config, calibrations: CalibrationSet) -> ArmLimits:
        """Return the limits the board holds against every sample itself, in its own counts."""
        ...

    def reference_counts(
        self, config: Config, calibrations: CalibrationSet, here: Sequence[float]
    ) -> tuple[int, ...]:
        """Return the counts of the three encoders where the rig stands at `here`, rad."""
        ...

    def check_setpoints(self, config: Config, setpoints: Sequence[FloatArray]) -> None:
        """Refuse setpoints that the limits forbid, before anything moves.

        Raises:
            SafetyTripError: One is beyond its limit or not finite.
        """
        ...

    def here(self, columns: Mapping[str, FloatArray]) -> tuple[float, ...]:
        """Return where it stood in the newest sample: the positions its setpoints ask for, rad."""
        ...

    def motion(self, plan: MachinePlan, here: tuple[float, ...]) -> MachineMotion:
        """Return the motion that makes a run, beginning where it stands.

        Raises:
            UsageError: The run is for another kind of rig.
        """
        ...

    def settling(self, here: tuple[float, ...]) -> MachineMotion:
        """Return the motion that lets friction give up the torque it holds."""
        ...

    def too_narrow(self, limits: ArmLimits, sample: np.void) -> tuple[ArmLimits, Trip]:
        """Return limits whose travel ends before where a sample stands, and the trip they make."""
        ...

    def beyond(self, limits: ArmLimits) -> tuple[NDArray[np.integer], ...]:
        """Return one setpoint beyond the travel, in counts."""
        ...

    def untroubled(self, limits: ArmLimits) -> ArmLimits:
        """Return the limits without those that a rig at rest may already be beyond."""
        ...
