"""The interface of a machine to a session, the same for every kind of rig."""

from collections.abc import Mapping, Sequence
from typing import Any, NoReturn, Self

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from drivers.teensy.profile import ArmLimits, Profile
from drivers.teensy.protocol import Trip
from estimation.recording import FloatArray
from rig.configuration.config import Config
from rig.errors import SafetyTripError, UsageError
from rig.log.schema import Stream
from rig.log.streams import COUNTS_STREAM
from rig.protocols.motion import Motion
from rig.protocols.protocol import Plan


class Machine:
    """One kind of rig; what a kind does not define is that of a rig without motors.

    Attributes:
        profile: Samples and motors of its board.
        counts: Stream of its raw counts in a log.
        setpoint_channels: Channel whose calibration makes counts of each field of a setpoint.
        setpoint_limits: Key of `[limits]` of each field of a setpoint.
        channels_of_inputs: Channel of each input of the board.
        here_channels: Channels whose values say where it stands, in the order of its setpoints.
        shown: Channels the live display shows, the main one first.
    """

    profile: Profile
    counts: Stream = COUNTS_STREAM
    setpoint_channels: tuple[str, ...] = ()
    setpoint_limits: tuple[str, ...] = ()
    channels_of_inputs: Mapping[str, str] = {}
    here_channels: tuple[str, ...] = ()
    shown: tuple[str, ...] = ()

    @classmethod
    def of(cls, config: Config) -> Self:
        """Return the machine of a configuration; by default the same for every one."""
        return cls()

    def at(self, rate_hz: float) -> Self:
        """Return the machine with the rate that its device really has; by default its only one."""
        return self

    def first_look(self, config: Config) -> str:
        """Return the shipped protocol for a quick check of this rig."""
        return "still"

    def gains(self, config: Config) -> Sequence[Any]:
        """Return the gains of every controller, as `TeensyLogger.arm` takes them."""
        self._refuse(config.logger.driver)

    def board_limits(self, config: Config, calibrations: CalibrationSet) -> ArmLimits:
        """Return the limits the board holds against every sample itself, in its own counts."""
        self._refuse(config.logger.driver)

    def train_rad(self, config: Config, here: Sequence[float]) -> dict[str, float]:
        """Return the angle of each encoder where the rig stands at `here`, without slack, rad."""
        return dict(zip(self.here_channels, here, strict=True))

    def reference_counts(
        self, config: Config, calibrations: CalibrationSet, here: Sequence[float]
    ) -> tuple[int, ...]:
        """Return the counts of the three encoders where the rig stands at `here`, rad."""
        if not self.here_channels:
            self._refuse(config.logger.driver)
        lines = calibrations.channels
        return tuple(
            round(angle / lines[name].slope + lines[name].zero_counts) if name in lines else 0
            for name, angle in self.train_rad(config, here).items()
        )

    def check_setpoints(self, config: Config, setpoints: Sequence[FloatArray]) -> None:
        """Refuse setpoints that the limits forbid, before anything moves.

        Raises:
            SafetyTripError: One is beyond its limit or not finite.
        """
        given = config.limits.model_dump()
        for name, values in zip(self.setpoint_limits, setpoints, strict=True):
            limit = given[name]
            if not np.isfinite(values).all() or np.abs(values).max(initial=0.0) > limit:
                raise SafetyTripError(
                    f"The trajectory asks for {name} = {np.abs(values).max():.3g}.",
                    f"The configured limit is {limit:g}; nothing was moved.",
                    f"Change the protocol, or [limits] {name} if the rig can take it.",
                )

    def require_within_limits(self, config: Config, plans: Sequence[Plan]) -> None:
        """Refuse runs that the limits forbid, before a rig is connected.

        The approach begins somewhere within the limits: here at zero.

        Raises:
            UsageError: A run is beyond a limit, or for another kind of rig.
        """
        for plan in plans:
            motion = self.motion(plan, (0.0,) * len(self.here_channels))
            try:
                if self.setpoint_channels:
                    self.check_setpoints(config, motion.setpoints)
            except SafetyTripError as error:
                raise UsageError(f"{plan.name}: {error.what}", error.why, error.fix) from error

    def here(self, columns: Mapping[str, FloatArray]) -> tuple[float, ...]:
        """Return where it stood in the newest sample: the positions its setpoints ask for, rad."""
        return tuple(float(columns[name][-1]) for name in self.here_channels)

    def motion(self, plan: Plan, here: tuple[float, ...]) -> Motion:
        """Return the motion that makes a run, beginning where it stands.

        Raises:
            UsageError: The run is for another kind of rig.
        """
        samples = round(plan.duration_s * self.profile.rate_hz)
        return Motion((np.zeros(samples),), 0, samples)

    def settling(self, here: tuple[float, ...]) -> Motion:
        """Return the motion that lets friction give up the torque it holds."""
        return Motion((np.zeros(0),), 0, 0)

    def too_narrow(self, limits: ArmLimits, sample: np.void) -> tuple[ArmLimits, Trip]:
        """Return limits whose travel ends before where a sample stands, and the trip they make."""
        self._refuse("device")

    def beyond(self, limits: ArmLimits) -> tuple[NDArray[np.integer], ...]:
        """Return one setpoint beyond the travel, in counts."""
        self._refuse("device")

    def untroubled(self, limits: ArmLimits) -> ArmLimits:
        """Return the limits without those that a rig at rest may already be beyond."""
        self._refuse("device")

    def _refuse(self, name: str) -> NoReturn:
        raise UsageError(
            f"A {name} has no motor that could be armed, moved or stopped.",
            'The configuration has [logger] profile = "sensor".',
            "Use `rig live` or `rig record` with it.",
        )
