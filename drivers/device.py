"""Interface of all drivers: typed channels, an identity, and samples in batches.

A driver is made from an open link, controls one device, and does nothing in the background: time
passes in `read`. Simulation swaps the link and nothing else.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntFlag
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from drivers.counters import DeviceCounters
from drivers.errors import LinkError


class SampleFlag(IntFlag):
    """Status of a sample from the device; 0 is good.

    The bits are those of a recording's flags, so that they pass on unchanged.
    """

    SATURATED = 1
    STALE = 2
    MISSING = 4
    SUSPECT = 8


def flags_of(
    saturated: NDArray[np.bool_], suspect: NDArray[np.bool_] | None = None
) -> NDArray[np.uint8]:
    """Return the `SampleFlag` bits of samples that are saturated or suspect, shape (n,)."""
    flags = saturated * np.uint8(SampleFlag.SATURATED)
    return flags if suspect is None else flags | suspect * np.uint8(SampleFlag.SUSPECT)


@dataclass(frozen=True, slots=True)
class Channel:
    """One quantity a device measures.

    Attributes:
        name: Column in a batch.
        unit: Unit of its values; `count` where a calibration has yet to be applied, `1` for none.
        lower: Lowest value the device can give; minus infinity where it is not known.
        upper: Highest.
    """

    name: str
    unit: str
    rate_hz: float
    lower: float
    upper: float
    description: str


AXES = ("force_x_n", "force_y_n", "force_z_n", "torque_x_n_m", "torque_y_n_m", "torque_z_n_m")
"""Channels of a force and torque sensor."""


def wrench_channels(rate_hz: float, tops: Sequence[float]) -> tuple[Channel, ...]:
    """Return three forces and three torques, given the largest value of each, N and N m."""
    kinds = [("N", "force")] * 3 + [("N m", "torque")] * 3
    return tuple(
        Channel(name, unit, rate_hz, -top, top, text)
        for name, (unit, text), top in zip(AXES, kinds, tops, strict=True)
    )


@dataclass(frozen=True, slots=True)
class DeviceIdentity:
    """Identity of the device; a part that it does not report is empty."""

    model: str
    serial: str
    firmware: str


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Samples in the order the device took them.

    Attributes:
        columns: Values by channel name, each float64 of shape (n,), in the channel's unit.
        time_s: When each sample was taken (`device` clock) or had arrived (`host` clock), s,
            shape (n,). The zero is arbitrary.
        sequence: Number of each sample since `start`, int64, shape (n,); lost samples are a gap
            where the device numbers its samples.
        flags: `SampleFlag` bits, uint8, shape (n,).
        lost: Samples known to be lost since `start`, up to the end of this batch. None is made up
            for.
    """

    columns: Mapping[str, NDArray[np.float64]]
    time_s: NDArray[np.float64]
    clock: Literal["device", "host"]
    sequence: NDArray[np.int64]
    flags: NDArray[np.uint8]
    lost: int

    def __len__(self) -> int:
        return int(self.time_s.size)


@runtime_checkable
class Device(Protocol):
    """One device over one link. Not for use by two threads at once."""

    @property
    def name(self) -> str:
        """Short name of the kind of device, as registered."""

    @property
    @abstractmethod
    def channels(self) -> tuple[Channel, ...]:
        """What `read` returns; complete once `identify` or `start` has been called."""

    @property
    def counters(self) -> Mapping[str, int]:
        """Counters of the link since it was opened.

        `frames` counts what came well; every other counter is a trouble, and 0 on a good link.
        """

    @abstractmethod
    def identify(self) -> DeviceIdentity:
        """Ask who is there.

        Raises:
            LinkTimeoutError: Nobody answers.
            DriverError: Somebody else answers.
        """

    @abstractmethod
    def start(self) -> None:
        """Let samples come; sequence numbers begin at 0."""

    @abstractmethod
    def read(self, timeout_s: float) -> Batch:
        """Return the samples that have come, waiting at most `timeout_s` for the first.

        Raises:
            LinkLostError: The link is gone.
        """

    @abstractmethod
    def stop(self) -> None:
        """Let no more samples come."""

    def close(self) -> None:
        """Stop, and let go of the link. Closing twice does nothing."""


@dataclass(frozen=True, slots=True)
class Axis:
    """What a drive measures of its motor.

    Attributes:
        position: Channel of its position.
        step: Position of one count, in the channel's unit.
        current: Channel of its current, A.
    """

    position: str
    step: float
    current: str


@runtime_checkable
class Drive(Device, Protocol):
    """A device with a motor, commanded and read in one cycle.

    A drive that is not read for a while takes its motor out of force by itself.
    """

    axis: Axis

    @property
    def now_s(self) -> float:
        """The clock of its samples, s."""

    @property
    def wait_s(self) -> float:
        """Time until the next sample is due, 0 when it is."""

    def idle(self, wait_s: float) -> None:
        """Let time pass without asking for a sample."""

    def arm(self) -> None:
        """Energise the motor, its command 0."""

    def command(self, ratio: float) -> None:
        """Command a share of full scale, -1 to 1, from the next reading on."""

    def disarm(self) -> None:
        """Take the motor out of force, and return when the drive has confirmed it.

        Raises:
            DisarmUnconfirmedError: It has not confirmed it; its state is unknown.
        """


class Clocked(Protocol):
    """The way to a device: a transport or a CAN bus."""

    @property
    def url(self) -> str:
        """The URL it was opened by."""

    @property
    def now_s(self) -> float:
        """Its clock, seconds from an arbitrary zero; virtual where time is."""

    def close(self) -> None:
        """Let go of it. Closing twice does nothing."""


class LinkedDevice(Device):
    """What every driver of a device on one link has.

    A driver gives `channels`, `identify`, `start`, `read` and `stop`.
    """

    def __init__(self, way: Clocked, rate_hz: float) -> None:
        self._way = way
        self._rate_hz = rate_hz
        self._counters = DeviceCounters()
        self._identified = self._closed = False

    @property
    def counters(self) -> dict[str, int]:
        """What happened on the way."""
        return self._counters.as_dict()

    def let_go(self) -> None:
        """Close the way to the device."""
        self._way.close()

    def close(self) -> None:
        """Stop where that can still be done, and let go of the way in any case."""
        if self._closed:
            return
        self._closed = True
        try:
            self.stop()
        except LinkError:
            pass  # it is gone already
        finally:
            self.let_go()
