"""The further devices of a rig, read with the logger and converted to its time.

A device that only streams has no readable clock: its samples are numbered, and the line from their
numbers to the host's clock is fitted through the earliest arrivals. The logger's clock is a line of
the host's too, so both are on one time base, each with the residual of its fit.
"""

from collections import deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from drivers.clock import ClockLine, arrival_fit
from drivers.device import Batch, Device
from drivers.errors import DriverError, LinkTimeoutError
from estimation.channels import unit_or_none
from rig.bench.logger import open_section
from rig.bench.sensor_logger import require_units
from rig.configuration.config import Config, is_simulated
from rig.configuration.sections import DeviceSection
from rig.errors import UsageError
from rig.log.devices import channel_of, topic_of
from rig.log.schema import Field, Stream
from rig.machines.safety import check_samples

REFIT_S = 0.5
ARRIVALS_KEPT = 2000
BATCHES_KEPT = 20_000
"""Batches kept without a reader; older ones are dropped."""
MOST_READS = 64
"""Most reads of one device a turn; a device that has more waits for the next."""
SILENCE_S, SILENT_PERIODS = 1.0, 5
"""With no sample for so long, s, and for so many of its periods, a device is taken for dead."""


@dataclass(frozen=True, slots=True, eq=False)
class Beside:
    """Samples of one device since it was last asked."""

    host_s: NDArray[np.float64]  # when each was taken, by the host's clock, shape (n,)
    columns: Mapping[str, NDArray[np.float64]]  # values by channel, each of shape (n,)
    sequence: NDArray[np.int64]  # number of each sample since the stream began, shape (n,)
    flags: NDArray[np.uint8]  # `SampleFlag` bits, shape (n,)


class Companion:
    """One device in addition to the logger.

    One that is `in_step` is a fake with a clock of its own, which is to keep step with the
    logger's. Limits are those of its limited channels, as `[limits]` names them: `NAME.channel`.
    """

    def __init__(
        self, name: str, device: Device, in_step: bool, limits: Mapping[str, float]
    ) -> None:
        self.name = name
        self.device = device
        self._in_step = in_step
        self._limits = limits
        self._began_s = 0.0
        self._newest = -1
        self._batches: deque[Batch] = deque(maxlen=BATCHES_KEPT)
        self._arrivals: list[tuple[int, float]] = []
        self._refit_at_s = 0.0
        self._quiet_since_s: float | None = None
        self.line: ClockLine | None = None
        """From sequence over rate to the host's clock, once there are arrivals enough."""

    @cached_property
    def rate_hz(self) -> float:
        """Its nominal rate."""
        return self.device.channels[0].rate_hz

    @property
    def channels(self) -> dict[str, str]:
        """Its channels, by the names that `[limits]` has for them."""
        return {f"{self.name}.{channel.name}": channel.name for channel in self.device.channels}

    @property
    def recorded(self) -> dict[str, str]:
        """Its channels with a unit, by the names that a recording and the display have for them."""
        named = {channel_of(self.name, one.name): one.name for one in self.device.channels}
        return {name: own for name, own in named.items() if unit_or_none(name) is not None}

    def begin(self, now_s: float) -> None:
        """Identify it and let its samples come.

        Raises:
            DriverError: It does not answer, or a channel has another unit than its name.
        """
        self.device.identify()
        require_units(self.device.name, self.device.channels)
        self.device.start()
        self._began_s = now_s

    def poll(self, now_s: float) -> None:
        """Take in what has come by now, without waiting for it.

        Raises:
            DriverError: It is gone, silent, or reports a fault.
            SafetyTripError: A value is beyond its limit. The caller disarms the rig.
        """
        due = (now_s - self._began_s) * self.rate_hz
        for _ in range(MOST_READS):
            if self._in_step and self._newest >= due:
                return
            batch = self.device.read(0.05 if self._in_step else 0.0)
            if len(batch):
                self._take(batch, now_s)
            elif not self._in_step:
                break
        self._refuse_silence(now_s)

    def take(self) -> Beside:
        """Return the samples since the last call, on the host's clock."""
        batches = list(self._batches)
        self._batches.clear()
        names = [channel.name for channel in self.device.channels]
        sequence = _joined([batch.sequence for batch in batches], np.int64)
        time_s = _joined([batch.time_s for batch in batches], np.float64)
        return Beside(
            self._on_host(sequence, time_s),
            {n: _joined([batch.columns[n] for batch in batches], np.float64) for n in names},
            sequence,
            _joined([batch.flags for batch in batches], np.uint8),
        )

    def stream(self) -> Stream:
        """Return its stream in a log."""
        return Stream(
            topic_of(self.name),
            f"rig_msgs/msg/{''.join(part.title() for part in self.name.split('_'))}",
            (
                Field("time_s", "float64", "s", "time of the run, by the logger's clock"),
                *(
                    Field(c.name, "float64", "" if c.unit == "count" else c.unit, c.description)
                    for c in self.device.channels
                ),
                Field("sequence", "uint32", "", "number of the sample since the stream began"),
                Field("flags", "uint32", "", "1 saturated, 2 stale, 4 missing, 8 suspect"),
            ),
            None,
        )

    def _refuse_silence(self, now_s: float) -> None:
        """Count from the first poll that found nothing: a pause of this computer does not count."""
        if self._quiet_since_s is None:
            self._quiet_since_s = now_s
        longest_s = max(SILENCE_S, SILENT_PERIODS / self.rate_hz)
        if now_s - self._quiet_since_s > longest_s:
            raise LinkTimeoutError(
                f"Device {self.name!r} has sent no sample for {longest_s:g} s.",
                "Its cable was pulled, it lost its supply, or what it sends is damaged.",
                "Check its cable and its supply, then start again; nothing recorded is lost.",
            )

    def _take(self, batch: Batch, now_s: float) -> None:
        self._quiet_since_s = None
        self._newest = int(batch.sequence[-1])
        self._batches.append(batch)
        if self._limits:
            columns = {limit: batch.columns[name] for limit, name in self.channels.items()}
            check_samples(self._limits, columns, np.full(len(batch), now_s - self._began_s))
        if self._in_step:
            return
        self._arrivals = [*self._arrivals[-ARRIVALS_KEPT:], (self._newest, float(now_s))]
        if now_s >= self._refit_at_s and len(self._arrivals) > 2:
            numbers, arrived_s = (np.array(column) for column in zip(*self._arrivals, strict=True))
            self.line = arrival_fit(numbers, arrived_s, self.rate_hz)
            self._refit_at_s = now_s + REFIT_S

    def _on_host(
        self, sequence: NDArray[np.int64], time_s: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        if self._in_step:
            return np.asarray(self._began_s + sequence / self.rate_hz)
        return time_s if self.line is None else self.line.to_host(sequence / self.rate_hz)


def refuse_shared_names(companions: Sequence[Companion], channels: Collection[str]) -> None:
    """Refuse an identified device with a channel that a recording has of another one already.

    The channels are those of the device in the logger's place.

    Raises:
        UsageError: Names the channel and the device.
    """
    taken = dict.fromkeys(channels, "[logger]")
    for companion in companions:
        for name in companion.recorded:
            if name in taken:
                raise UsageError(
                    f"[devices.{companion.name}] and {taken[name]} both have the channel {name!r}.",
                    "A recording has one column of each name.",
                    f"Give [devices.{companion.name}] another name.",
                )
            taken[name] = f"[devices.{companion.name}]"


def open_companions(config: Config) -> list[Companion]:
    """Open every further device of a configuration; when one fails, the others are closed.

    Raises:
        DriverError: One cannot be opened.
    """
    opened: list[Companion] = []
    try:
        for name, section in config.devices.items():
            device = _open_named(name, section)
            limits = {n: v for n, v in config.limits.further.items() if n.startswith(f"{name}.")}
            opened.append(Companion(name, device, is_simulated(section.url), limits))
    except BaseException:
        for companion in opened:
            companion.device.close()
        raise
    return opened


def _open_named(name: str, section: DeviceSection) -> Device:
    try:
        return open_section(section)
    except DriverError as error:
        error.what = f"Device {name!r}: {error.what}"
        error.fix = error.fix or f"Check its supply, its cable, and the url of [devices.{name}]."
        raise


def _joined(parts: list[NDArray], dtype: type) -> NDArray:  # type: ignore[type-arg]
    return np.concatenate(parts).astype(dtype) if parts else np.empty(0, dtype)
