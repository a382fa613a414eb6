"""Devices that must be asked for every sample: their steady rate, and what their drivers share."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from drivers.device import Batch, Clocked, LinkedDevice
from drivers.errors import DisarmUnconfirmedError, DriverError, FrameError, LinkTimeoutError


class PolledDevice(LinkedDevice):
    """A device that is asked for every sample, at a steady rate.

    A driver gives `channels`, `identify`, `idle` and `sample`, and may give `judge`.

    Args:
        rate_hz: Polling rate. A request without an answer is a gap in `sequence`.
        late_s: How late a question may be and still be asked; later ones are lost.

    Raises:
        ValueError: The rate is not above 0.
    """

    def __init__(self, way: Clocked, rate_hz: float, late_s: float = 0.0) -> None:
        if not rate_hz > 0:
            raise ValueError(f"a rate is above 0 Hz, not {rate_hz}")
        super().__init__(way, rate_hz)
        self._late_s = late_s
        self._restart()

    @property
    def now_s(self) -> float:
        """The clock of its samples, s."""
        return self._way.now_s

    @property
    def wait_s(self) -> float:
        """Time until the next sample is due, 0 when it is."""
        wait_s = self._began_s + self._asked / self._rate_hz - self._way.now_s
        return wait_s if wait_s > 1e-9 else 0.0

    def idle(self, wait_s: float) -> None:
        """Let time pass; what comes unasked is late, and dropped."""
        raise NotImplementedError

    def sample(self) -> tuple[Sequence[float], int]:
        """Ask for a sample; return a value for each channel, and its `SampleFlag` bits.

        Raises:
            LinkTimeoutError: Nobody answers; the sample is lost.
            FrameError: The answer is damaged; the sample is lost.
        """
        raise NotImplementedError

    def judge(self) -> None:
        """Raise what the newest answer, or that there was none, means for the device."""

    def start(self) -> None:
        """Number the samples from 0, the first being due now."""
        if not self._identified:
            self.identify()
        self.idle(0.0)
        self._restart()

    def read(self, timeout_s: float) -> Batch:
        """Ask when the next sample is due and return it, or nothing when it is not due in time.

        Raises:
            DriverError: The device reports a fault; or neither `identify` nor `start` was called.
        """
        if not self._identified:
            raise DriverError("The device is not known.", fix="Call start first.")
        self.idle(max(0.0, min(self.wait_s, timeout_s)))
        if self.wait_s > 0:
            return self._batch(None)
        late_s = self._way.now_s - self._late_s - self._began_s
        missed = int(late_s * self._rate_hz + 1e-6) - self._asked
        if missed > 0:
            self._lose(missed)
        sample = None
        try:
            sample = self.sample()
        except (LinkTimeoutError, FrameError):
            self._lose(1)
        else:
            self._asked += 1
            self._counters.frames += 1
        self.judge()
        return self._batch(sample)

    def stop(self) -> None:
        """Do nothing: a device that is not asked is silent."""

    def _restart(self) -> None:
        self._began_s = self._way.now_s
        self._asked = self._lost = 0

    def _lose(self, samples: int) -> None:
        self._asked += samples
        self._lost += samples
        self._counters.gaps += 1
        self._counters.lost += samples

    @cached_property
    def _names(self) -> list[str]:
        return [channel.name for channel in self.channels]

    def _batch(self, sample: tuple[Sequence[float], int] | None) -> Batch:
        count = 0 if sample is None else 1
        values, flags = sample or ([0.0] * len(self._names), 0)
        return Batch(
            {name: np.full(count, value) for name, value in zip(self._names, values, strict=True)},
            np.full(count, self._way.now_s),
            "host",
            np.full(count, self._asked - 1, np.int64),
            np.full(count, flags, np.uint8),
            self._lost,
        )


class PolledDrive(PolledDevice):
    """A motor controller that is commanded and asked in one cycle.

    A driver gives `energise` and `release` besides what every polled device gives, and keeps its
    command in `_goal`, or gives `zero`.

    Args:
        rate_hz: Polling rate.
        own_watch: What a working drive does by itself when nobody asks, one sentence.
        late_s: See `PolledDevice`.
    """

    def __init__(
        self, way: Clocked, rate_hz: float, title: str, own_watch: str, late_s: float = 0.0
    ) -> None:
        super().__init__(way, rate_hz, late_s)
        self._title = title
        self._own_watch = own_watch
        self._armed = self._may_be_armed = False
        self._goal = 0.0

    def energise(self) -> None:
        """Energise the motor, without current."""
        raise NotImplementedError

    def release(self) -> None:
        """Take the motor out of force, and return when the drive has confirmed it."""
        raise NotImplementedError

    def zero(self) -> None:
        """Forget the command; a driver that keeps it elsewhere than in `_goal` forgets it there."""
        self._goal = 0.0

    def arm(self) -> None:
        """Energise the motor, its command 0, watched by the drive itself.

        Raises:
            DriverError: The drive has an error, or does not get into operation.
        """
        if not self._identified:
            raise DriverError(f"The {self._title} is not started.", fix="Call start first.")
        self.disarm()
        self.put_in_force()

    def put_in_force(self) -> None:
        """Energise the motor of a healthy drive; errors as `arm`."""
        self._may_be_armed = True
        self.zero()
        self.energise()
        self._armed = True

    def disarm(self) -> None:
        """Take the motor out of force, and return when the drive has confirmed it.

        Raises:
            DisarmUnconfirmedError: It has not confirmed it; its state is unknown.
        """
        self._armed = False
        self.zero()
        try:
            self.release()
        except DriverError as error:
            raise DisarmUnconfirmedError(
                f"The {self._title} has not confirmed that its motor is out of force.",
                str(error),
                f"Take the motor for live and cut its supply. {self._own_watch}",
            ) from error
        self._may_be_armed = False

    def stop(self) -> None:
        """Disarm where the drive may be armed; one that is not asked is silent.

        Raises:
            DisarmUnconfirmedError: The drive's state is unknown.
        """
        if self._may_be_armed:
            self.disarm()

    def require(self, value: float, limit: float, unit: str) -> None:
        """Refuse a command that cannot be.

        Raises:
            DriverError: Not armed, not finite, or beyond the drive's limit.
        """
        if not self._armed:
            raise DriverError(f"The {self._title} is not armed.", fix="Call arm first.")
        if not abs(value) <= limit:  # what is not a number is beyond it
            raise DriverError(
                f"{value:g} {unit} cannot be commanded.",
                f"The limit is {limit:g} {unit}.",
                "Command less, or raise the limit if motor and rig allow.",
            )
