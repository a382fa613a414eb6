"""The logger as a device among others: it only measures; `TeensyLogger` also moves things."""

from collections.abc import Mapping

import numpy as np

from drivers.device import Batch, Channel, DeviceIdentity, LinkedDevice, flags_of
from drivers.registry import Driver
from drivers.streaming import LONGEST_SILENCE_S, Arrivals
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.profile import Profile
from drivers.teensy.protocol import STATUS_LIMIT_TRIPPED, STATUS_SATURATED, STATUS_WATCHDOG_TRIPPED
from drivers.teensy.reference import REFERENCE
from drivers.transport import open_transport
from drivers.transport.transport import Transport

ADC_BITS = 12
_TRIPPED = STATUS_WATCHDOG_TRIPPED | STATUS_LIMIT_TRIPPED


def raw_channel(
    name: str, field: str, profile: Profile = REFERENCE, description: str = ""
) -> Channel:
    """Return a field of a board's samples as a channel of its counts."""
    low, high = 0, 2**ADC_BITS - 1
    if not field.startswith(("fsr", "force_")):
        bounds = np.iinfo(profile.sample[field])
        low, high = int(bounds.min), int(bounds.max)
    about = description or f"field {field}"
    return Channel(name, "count", profile.rate_hz, low, high, about)


def raw_channels(profile: Profile = REFERENCE) -> dict[str, Channel]:
    """Return every input of a board, by its field of a sample."""
    inputs = [*profile.input_names, *(["fsr"] if profile is REFERENCE else [])]
    return {field: raw_channel(f"{field}_count", field, profile) for field in inputs}


class TeensyDevice(LinkedDevice):
    """The logger's stream in units, time-stamped by its own clock. It is never armed.

    `wired` are channels by the field of a sample; all inputs by default.
    """

    name = "teensy"

    def __init__(
        self,
        transport: Transport,
        wired: Mapping[str, Channel] | None = None,
        profile: Profile = REFERENCE,
    ) -> None:
        super().__init__(transport, profile.rate_hz)
        self._wired = raw_channels(profile) if wired is None else wired
        self.logger = TeensyLogger(transport, profile)
        self._arrivals = Arrivals(self._counters, LONGEST_SILENCE_S)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What is wired, in the order given."""
        return tuple(self._wired.values())

    @property
    def counters(self) -> dict[str, int]:
        """The link's counters, and the silences of the stream."""
        return super().counters | self.logger.counters.as_dict()

    def identify(self) -> DeviceIdentity:
        """Read the board's identity and check its protocol version, as `TeensyLogger.identify`."""
        identity = self.logger.identify()
        return DeviceIdentity("Teensy logger", identity.serial, identity.firmware_version)

    def start(self) -> None:
        """Start the stream; sequence numbers begin at 0."""
        self.logger.start()
        self._arrivals.restart(self._way.now_s)

    def read(self, timeout_s: float) -> Batch:
        """Return the samples that have come, with the board's own time."""
        batch = self.logger.read(timeout_s)
        self._arrivals.number(len(batch.samples), self._way.now_s)
        status = batch.samples["status"]
        return Batch(
            {
                channel.name: batch.samples[field].astype(np.float64)
                for field, channel in self._wired.items()
            },
            np.multiply(batch.tick_us, 1e-6),
            "device",
            batch.samples["sequence"].astype(np.int64),
            flags_of((status & STATUS_SATURATED) != 0, (status & _TRIPPED) != 0),
            batch.lost,
        )

    def stop(self) -> None:
        """Stop the stream."""
        self.logger.stop()

    def let_go(self) -> None:
        """Disarm where the board may be armed, and let go of the link."""
        self.logger.close()


def open_teensy(url: str) -> TeensyDevice:
    """Open the logger at a serial port or a USB identity, its inputs in raw counts."""
    return TeensyDevice(open_transport(url))


DRIVER = Driver("teensy", "The 1 kHz logger on a Teensy 3.5 or 4.1", open_teensy)
