"""A device without motors where a session expects a logger: it gives its samples as they are."""

from collections.abc import Sequence
from time import monotonic
from typing import NoReturn

import numpy as np

from drivers.counters import LinkCounters
from drivers.device import Channel, Device
from drivers.errors import DriverError
from drivers.teensy.driver import ClockExchange, SampleBatch
from drivers.teensy.protocol import Identity, Trip, TripReport
from drivers.transport.simulated import Pace
from estimation.channels import unit_or_none
from rig.errors import UsageError

FLAGS = "flags"
"""Field of a device's own `SampleFlag` bits among the samples."""
RATE_S, RATE_SAMPLES = 5.0, 20
"""A rate is measured over so long, s, and over so many samples."""
RATE_TOLERANCE = 0.05
SETTLE_S = 1.0
"""After a start and after a pause what had gathered is read this long, s, before rates count."""
PAUSE_S = 0.5
_HEAD = (("sequence", "<u4"), ("tick_us", "<u4"), ("status", "<u2"), (FLAGS, "u1"))


class SensorWay:
    """A device without motors, with the interface of `drivers.transport.Transport`.

    Bytes cannot be sent through it: what arms, stops or tests a rig is refused. The time of a
    simulated one passes only while it is read, at a pace of simulated seconds a real second; None
    for as fast as possible.
    """

    def __init__(
        self, device: Device, url: str, is_simulated: bool, pace: float | None = None
    ) -> None:
        self.url = url
        self.device = device
        self.is_simulated = is_simulated
        self.pace = Pace(pace)
        self.close = device.close
        self.now_s = 0.0 if is_simulated else monotonic()
        """Time of the newest reading."""

    def pass_time(self, seconds: float) -> None:
        """Let time pass: that of the samples that came where it is simulated."""
        self.now_s = self.now_s + seconds if self.is_simulated else monotonic()
        self.pace.keep(self.now_s)

    def refuse(self, *_: object, **__: object) -> NoReturn:
        """Refuse what a device without motors cannot do."""
        raise UsageError(
            f"The {self.device.name} at {self.url} has no motors to arm, stop or test.",
            'The configuration has [logger] profile = "sensor".',
            "Use `rig live` or `rig record` with it.",
        )

    read = write = refuse


def require_units(name: str, channels: Sequence[Channel]) -> None:
    """Refuse a channel of a driver whose name ends in another unit than it has (DriverError)."""
    for channel in channels:
        named = unit_or_none(channel.name)
        if named is not None and named != channel.unit:
            raise DriverError(
                f"The driver {name} has a channel {channel.name!r} in {channel.unit!r}.",
                f"The end of its name states {named}, and it would be recorded as that.",
                "Correct the unit or the name in the driver.",
            )


class RateWatch:
    """Compares the rate at which samples arrive with the nominal one, which makes their times."""

    def __init__(self, name: str, rate_hz: float) -> None:
        self._name = name
        self._rate_hz = rate_hz
        self._span_s = max(RATE_S, RATE_SAMPLES / rate_hz)
        self._first: tuple[int, float] | None = None
        self._read_s = self._settled_s = -np.inf

    def check(self, asked_s: float, arrived_s: float, sequence: int | None) -> None:
        """Take one read: when it began and ended, and the number of its newest sample, if any.

        Raises:
            DriverError: The rates differ by more than `RATE_TOLERANCE`.
        """
        if asked_s - self._read_s > PAUSE_S:  # samples that nobody reads may be lost uncounted
            self._first, self._settled_s = None, asked_s + SETTLE_S
        self._read_s = arrived_s
        if sequence is None or arrived_s < self._settled_s:
            return
        first_sequence, first_s = self._first = self._first or (sequence, arrived_s)
        if arrived_s - first_s < self._span_s:
            return
        rate_hz = (sequence - first_sequence) / (arrived_s - first_s)
        self._first = (sequence, arrived_s)
        if abs(rate_hz - self._rate_hz) > RATE_TOLERANCE * self._rate_hz:
            raise DriverError(
                f"The {self._name} sends {rate_hz:.4g} Hz; {self._rate_hz:.4g} Hz is configured.",
                "Its samples have no times of their own: those of the recording would be wrong.",
                "Set the rate on the device, or `rate_hz` in the options of [logger].",
            )


class SensorLogger:
    """A device without motors, with the calls of `TeensyLogger` that a session makes."""

    def __init__(self, way: SensorWay) -> None:
        self._way = way
        self._device = way.device
        self.start, self.stop, self.close = way.device.start, way.device.stop, way.close
        self.arm = self.queue = way.refuse
        self._first_s: float | None = None
        self._next = 0
        self._rate_watch: RateWatch | None = None
        self.channels: tuple[Channel, ...] = ()
        self.last_exchange: ClockExchange | None = None

    @property
    def counters(self) -> LinkCounters:
        """What happened to the device's samples."""
        counted = self._device.counters
        return LinkCounters(**{name: counted.get(name, 0) for name in LinkCounters().as_dict()})

    def identify(self) -> Identity:
        """Ask who is there."""
        found = self._device.identify()
        self.channels = self._device.channels
        require_units(self._device.name, self.channels)
        if not self._way.is_simulated:
            self._rate_watch = RateWatch(self._device.name, self.channels[0].rate_hz)
        serial = " ".join(part for part in (found.model, found.serial) if part)
        return Identity(serial, found.firmware, 0)

    def disarm(self) -> None:
        """Do nothing: it has no motors."""

    def heartbeat(self) -> None:
        """Do nothing: nothing waits for it."""

    def trip(self) -> TripReport:
        """Return that nothing tripped."""
        return TripReport(Trip.NONE, "", 0, 0, 0, 0)

    def read(self, timeout_s: float) -> SampleBatch:
        """Return the samples that have come, waiting at most `timeout_s` for the first.

        Times are the device's own where it has a clock, else by its nominal rate, which real
        time must confirm.

        Raises:
            DriverError: The device fails, or has another rate.
        """
        before_s, asked_s = self._way.now_s, monotonic()
        batch = self._device.read(timeout_s)
        rate_hz = self.channels[0].rate_hz
        count = int(batch.sequence[-1]) + 1 - self._next if len(batch) else 0
        self._next += count
        self._way.pass_time(count / rate_hz if len(batch) else timeout_s)
        if self._rate_watch is not None and batch.clock == "host":
            newest = int(batch.sequence[-1]) if len(batch) else None
            self._rate_watch.check(asked_s, self._way.now_s, newest)
        dtype = np.dtype([*_HEAD, *((c.name, "<f8") for c in self.channels)])
        samples = np.zeros(len(batch), dtype)
        if not len(batch):
            return SampleBatch(samples, np.empty(0, np.int64), batch.lost)
        time_s = batch.sequence / rate_hz if batch.clock == "host" else batch.time_s
        if self._first_s is None:
            self._first_s = float(time_s[0])
        tick_us = np.round((time_s - self._first_s) * 1e6).astype(np.int64)
        samples["sequence"], samples["tick_us"] = batch.sequence, tick_us % 2**32
        samples[FLAGS] = batch.flags
        for channel in self.channels:
            samples[channel.name] = batch.columns[channel.name]
        self.last_exchange = ClockExchange(before_s, self._way.now_s, int(tick_us[-1]) % 2**32)
        return SampleBatch(samples, tick_us, batch.lost)
