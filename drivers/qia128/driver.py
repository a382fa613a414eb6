"""The driver of a QIA128: its calibration is read from it, then it streams."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.counters import silent
from drivers.device import Channel, DeviceIdentity, flags_of
from drivers.errors import DriverError
from drivers.qia128 import protocol
from drivers.registry import Driver, RateOption, opener
from drivers.streaming import Samples, SlidingFrames, StreamedDevice
from drivers.transport.transport import Transport, arriving

RATE_HZ = 1300.0
Unit = Literal["N m", "N", "1"]
COLUMNS: dict[Unit, str] = {"N m": "torque_n_m", "N": "force_n", "1": "load_ratio"}
"""Unit of the rated load to the channel's name, which ends in it."""
REPLY_TIMEOUT_S = 0.2


class Qia128(StreamedDevice):
    """One amplifier on a UART.

    Args:
        rated_load: Load of the calibration's full-scale point, from the certificate.
        unit: Unit of `rated_load`, `N m` or `N`; `1` gives the fraction of full scale.
        rate_hz: Samples a second. 1300 is set; for any other rate, the amplifier is left as it is.
        serial: Serial number from its label, for one that does not answer the question for it as
            assumed, with four bytes high byte first: then it is not asked.
    """

    name = "qia128"

    def __init__(
        self,
        transport: Transport,
        rated_load: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1.0,
        unit: Unit = "1",
        rate_hz: RateOption = RATE_HZ,
        serial: str = "",
    ) -> None:
        super().__init__(transport, rate_hz, "QIA128")
        self._rated_load = rated_load
        self._unit = unit
        self._column = COLUMNS[unit]
        self._serial = serial
        self._frames = SlidingFrames(protocol.FRAME_SIZE, protocol.frame_checks, self._counters)
        self._points: tuple[int, int] | None = None

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The load; its range is known once the calibration has been read."""
        low, high = -np.inf, np.inf
        if self._points is not None:
            low, high = np.sort(self._load(np.array([0.0, protocol.TOP]))).tolist()
        return (Channel(self._column, self._unit, self._rate_hz, low, high, "load on the sensor"),)

    def identify(self) -> DeviceIdentity:
        """End the stream, ask for the serial number and the calibration.

        Raises:
            DriverError: The calibration's two points are the same.
        """
        self.quieten()
        serial = self._serial or str(self._number(protocol.GET_SERIAL))
        zero, full = (
            self._number(protocol.GET_CALIBRATION, bytes([0, point]))
            for point in (protocol.ZERO_POINT, protocol.FULL_SCALE_POINT)
        )
        if zero == full:
            raise DriverError(
                f"The QIA128 {serial} has no calibration.",
                f"Its zero and its full-scale point are both {zero}.",
                "Calibrate it with FUTEK's software, or give it its certificate's values.",
            )
        self._points = zero, full
        self._identified = True
        return DeviceIdentity("QIA128", serial, "")

    def begin(self) -> None:
        """Switch the stream on."""
        if self._rate_hz == RATE_HZ:
            self._transport.write(protocol.set_rate())
        self.quieten()
        self._frames.restart()
        self._transport.write(protocol.set_stream(True))

    def receive(self, timeout_s: float) -> Samples:
        """Return the loads that have come; a reading at an end of the range is saturated."""
        raw = protocol.readings(self._frames.read(self._transport, timeout_s))
        flags = flags_of((raw == 0) | (raw == protocol.TOP))
        return {self._column: self._load(raw.astype(np.float64))}, flags

    def stop(self) -> None:
        """Switch the stream off."""
        self._transport.write(protocol.set_stream(False))

    def _load(self, raw: NDArray[np.float64]) -> NDArray[np.float64]:
        assert self._points is not None  # noqa: S101
        zero, full = self._points
        return (raw - zero) * (self._rated_load / (full - zero))

    def _number(self, command: tuple[int, int], payload: bytes = b"") -> int:
        question = protocol.encode_packet(command, payload)
        for _ in self._counters.attempts():
            self._transport.write(question)
            for came in arriving(self._transport, REPLY_TIMEOUT_S):
                found = protocol.find_packet(came, command)
                if found is not None and len(found[0]) == 4:
                    return int.from_bytes(found[0], "big")
            self._counters.discarded_bytes += len(came)
        check = "Check its supply, the two data lines, and the bit rate."
        raise silent("QIA128", self._transport.url, REPLY_TIMEOUT_S, check)


DRIVER = Driver(
    "qia128",
    "FUTEK QIA128 digital amplifier, UART",
    opener(Qia128, "QIA128", baud_rate=320_000),
)
"""No public source gives the bit rate of its UART."""
