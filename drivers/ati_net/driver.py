"""The driver of a Net F/T: calibration by TCP, then a stream of records by UDP."""

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.ati_net import protocol
from drivers.ati_net.stream import RecordSequence, StreamWatch
from drivers.device import AXES, Batch, Channel, DeviceIdentity, flags_of, wrench_channels
from drivers.errors import FrameError, LinkTimeoutError
from drivers.registry import Driver
from drivers.streaming import Samples, StreamedDevice
from drivers.transport import open_transport
from drivers.transport.transport import Transport, arriving
from drivers.transport.udp import split_address

ANSWER_TIMEOUT_S = 1.0
MOST_DATAGRAMS = 10_000
"""Datagrams taken in one read: a second and a half of the fastest stream."""


class AtiNet(StreamedDevice):
    """One force/torque sensor with a Net Box, or an Ethernet Axia.

    Its TCP port, which `open_calibration` opens, is asked for counts per unit. The rate is the RDT
    rate set on its web page.
    """

    name = "ati-net"

    def __init__(
        self,
        transport: Transport,
        open_calibration: Callable[[], Transport],
        rate_hz: float = 1000.0,
    ) -> None:
        super().__init__(transport, rate_hz, "force/torque sensor")
        self._open_calibration = open_calibration
        self._slopes = np.full(6, np.inf)
        self._sequence = RecordSequence(self._counters)
        self._numbers = np.empty(0, np.int64)
        self._watch = StreamWatch(transport.url, rate_hz, self._counters)
        self._streams = False
        self.status = 0
        """Status word of the newest record; `protocol.status_words` puts it in words."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Three forces and three torques; their range is known once the calibration is."""
        return wrench_channels(self._rate_hz, (self._slopes * 2.0**31).tolist())

    @property
    def counts_per_unit(self) -> dict[str, float]:
        """Counts per newton and newton metre, from the device; empty before they are read."""
        if not self._identified:
            return {}
        force, torque = float(self._slopes[0]), float(self._slopes[3])
        return {"counts_per_n": 1.0 / force, "counts_per_n_m": 1.0 / torque}

    def identify(self) -> DeviceIdentity:
        """Read the calibration: units and counts per unit. Serial and firmware are not available.

        Raises:
            FrameError: The answer is not a calibration.
        """
        link = self._open_calibration()
        try:
            link.write(protocol.READ_CALIBRATION)
            answer = b""
            for answer in arriving(link, ANSWER_TIMEOUT_S):
                if len(answer) >= protocol.CALIBRATION_SIZE:
                    break
        finally:
            link.close()
        if not answer:
            self._counters.timeouts += 1
            raise LinkTimeoutError(
                f"No Net F/T answers at {link.url}.",
                f"It was asked for its calibration and had {ANSWER_TIMEOUT_S:g} s.",
                "Check its power, the cable, and that this computer is in its network.",
            )
        self._slopes = protocol.decode_calibration(answer).slopes()
        self._identified = True
        return DeviceIdentity("ATI Net F/T", "", "")

    def begin(self) -> None:
        """Ask for the stream; the first record that comes has the number 0."""
        self.stop()
        while self._transport.read(0.0):
            pass  # of an earlier stream
        self._sequence.restart()
        self._transport.write(protocol.encode_command(protocol.STREAM))
        self._watch.restart(self._transport.now_s)
        self._streams = True

    def read(self, timeout_s: float) -> Batch:
        """Return the records that have come, stamped with the time of this read.

        A stream that is silent is requested again.

        Raises:
            LinkTimeoutError: It stays silent.
            DriverError: The sensor is frozen; or neither `identify` nor `start` has been called.
        """
        batch = super().read(timeout_s)
        return replace(batch, sequence=self._numbers, lost=self._sequence.lost)

    def receive(self, timeout_s: float) -> Samples:
        """Return the values and flags of the records that are new and in order."""
        records = self._records(timeout_s)
        if self._streams:
            self._follow(records["ft_sequence"].astype(np.uint32))
        kept, self._numbers = self._sequence.follow(records["rdt_sequence"])
        records = records[kept]
        self._counters.frames += len(records)
        values = records["counts"] * self._slopes
        flags = self._flags(records["status"].astype(np.uint32))
        return dict(zip(AXES, values.T, strict=True)), flags

    def set_bias(self) -> None:
        """Take the present load for zero, in the device; it does not answer.

        A command replaces the one that runs, so the stream is requested again after it.
        """
        self._transport.write(protocol.encode_command(protocol.SET_BIAS))
        self._ask_again()

    def reset_latch(self) -> None:
        """Clear the latched threshold; the stream is requested again after it."""
        self._transport.write(protocol.encode_command(protocol.RESET_LATCH))
        self._ask_again()

    def stop(self) -> None:
        """End the stream."""
        self._streams = False
        self._transport.write(protocol.encode_command(protocol.STOP))

    def _ask_again(self) -> None:
        """Request the stream again where it is to run; its records are numbered from 1 again."""
        if self._streams:
            self._sequence.expect_restart()
            self._transport.write(protocol.encode_command(protocol.STREAM))

    def _follow(self, internal: NDArray[np.uint32]) -> None:
        now_s = self._transport.now_s
        if not len(internal) and self._watch.is_to_be_asked_again(now_s):
            self._ask_again()
        self._watch.follow(internal, now_s)

    def _records(self, timeout_s: float) -> NDArray[np.void]:
        good = []
        datagram = self._transport.read(timeout_s)
        while datagram:
            try:
                good.append(protocol.decode_records(datagram))
            except FrameError:
                self._counters.unknown_frames += 1
                self._counters.discarded_bytes += len(datagram)
            if len(good) >= MOST_DATAGRAMS:
                break
            datagram = self._transport.read(0.0)
        return np.concatenate(good) if good else np.empty(0, protocol.RECORD_DTYPE)

    def _flags(self, status: NDArray[np.uint32]) -> NDArray[np.uint8]:
        faulty = protocol.is_data_fault(status)
        self._counters.device_errors += int(np.count_nonzero(faulty))
        if len(status):
            self.status = int(status[-1])
        return flags_of((status & np.uint32(protocol.SATURATED)) != 0, faulty)


def open_ati_net(url: str, rate_hz: Annotated[float, Field(ge=1, le=7800)] = 1000.0) -> AtiNet:
    """Open the sensor at `udp:HOST:49152`; its calibration is read from TCP port 49151."""
    host, _ = split_address(url)
    calibration = f"socket://{host}:{protocol.CALIBRATION_PORT}"
    return AtiNet(open_transport(url), lambda: open_transport(calibration), rate_hz)


DRIVER = Driver("ati-net", "ATI Net F/T or Ethernet Axia, RDT over UDP", open_ati_net)
