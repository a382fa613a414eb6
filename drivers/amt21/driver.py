"""The driver of an AMT21: it is polled for every sample, at a steady rate."""

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.amt21 import protocol
from drivers.amt21.turning import TOP_SPEED_RAD_S, RateGate, turns_at
from drivers.counters import DeviceCounters
from drivers.device import Batch, Channel, DeviceIdentity
from drivers.errors import FrameError, LinkError, LinkTimeoutError
from drivers.polling import PollSchedule
from drivers.registry import BaudOption, Driver, RateOption
from drivers.transport.serial_port import open_line
from drivers.transport.transport import Transport

TRIES = 3


class Amt21:
    """One encoder on an RS-485 line. Nothing else on the line may be asked at the same time.

    Args:
        transport: The way to the line; the device closes it.
        address: The encoder's address.
        multi_turn: Whether it also counts turns.
        rate_hz: Polling rate. A request without an answer is a gap in `sequence`.
        reply_timeout_s: Time for an answer, on a USB adapter some milliseconds.
        top_speed_rad_s: The fastest the shaft turns; a reading that would need more is damaged.
    """

    name = "amt21"

    def __init__(
        self,
        transport: Transport,
        address: int = protocol.DEFAULT_ADDRESS,
        multi_turn: bool = False,
        rate_hz: float = 200.0,
        reply_timeout_s: float = 0.01,
        top_speed_rad_s: float = TOP_SPEED_RAD_S,
    ) -> None:
        self._transport = transport
        self._requests = [protocol.request(address, turns) for turns in (False, True)]
        self._address = address
        self._multi_turn = multi_turn
        self._reply_timeout_s = reply_timeout_s
        self._counters = DeviceCounters()
        self._schedule = PollSchedule(rate_hz, self._counters)
        self._schedule.restart(transport.now_s)
        self._gate = RateGate(top_speed_rad_s, multi_turn)
        angle = Channel("angle_rad", "rad", rate_hz, 0.0, 2 * math.pi, "absolute angle, one turn")
        half = protocol.FULL_TURN // 2
        turns = Channel("turns", "1", rate_hz, -half, half - 1, "whole turns")
        self._channels = (angle, turns) if multi_turn else (angle,)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The angle, and the turns of a multi-turn encoder."""
        return self._channels

    @property
    def counters(self) -> dict[str, int]:
        """Counters of the line."""
        return self._counters.as_dict()

    def identify(self) -> DeviceIdentity:
        """Request one position: the encoder has no other identification.

        Raises:
            LinkTimeoutError: Nobody answers at this address.
        """
        if self._ask(turns=False) is None:
            raise LinkTimeoutError(
                f"No AMT21 answers at {self._transport.url}, address {self._address:#04x}.",
                f"It was asked {TRIES} times.",
                "Check supply, A and B, the address, and the bit rate (2 Mbit/s for types A to D).",
            )
        return DeviceIdentity("AMT21", "", "")

    def start(self) -> None:
        """Number the samples from 0, the first being due now."""
        self._discard(self._transport.read(0.0))
        self._schedule.restart(self._transport.now_s)
        self._gate.restart()

    def read(self, timeout_s: float) -> Batch:
        """Ask when the next sample is due and return it, or nothing when it is not due in time."""
        wait_s = self._schedule.wait_s(self._transport.now_s)
        self._discard(self._transport.read(max(0.0, min(wait_s, timeout_s))))
        now_s = self._transport.now_s
        if self._schedule.wait_s(now_s) > 0:
            return self._batch(None)
        self._schedule.skip_missed(now_s)
        position = self._plausible()
        if position is None:
            self._schedule.lose()
            return self._batch(None)
        self._gate.accept(position, self._transport.now_s)
        self._schedule.asked += 1
        self._counters.frames += 1
        return self._batch(position)

    def stop(self) -> None:
        """Do nothing: an encoder that is not asked is silent."""

    def close(self) -> None:
        """Let go of the line."""
        self._transport.close()

    def _plausible(self) -> int | None:
        """Return a position that the shaft can have, None without a good one.

        A position out of reach is asked for again: it was damaged, unless the second one agrees.
        """
        first = self._measure()
        first_s = self._transport.now_s
        if first is None or self._gate.fits(first, first_s):
            return first
        self._counters.crc_errors += 1
        self._counters.retries += 1
        second = self._measure()
        if second is None:
            return None
        now_s = self._transport.now_s
        if self._gate.fits(second, now_s) or self._gate.is_near(second, first, now_s - first_s):
            return second
        self._counters.crc_errors += 1
        self._counters.timeouts += 1
        return None

    def _measure(self) -> int | None:
        """Return the position, counts over all turns it counts; None without good answers."""
        before = self._ask(turns=True) if self._multi_turn else 0
        angle = None if before is None else self._ask(turns=False)
        after = self._ask(turns=True) if self._multi_turn and angle is not None else 0
        if before is None or angle is None or after is None:
            return None
        turns = turns_at(angle, before, after)
        if turns is None:
            self._counters.crc_errors += 1
            return None
        return turns * protocol.FULL_TURN + angle

    def _batch(self, position: int | None) -> Batch:
        count = 0 if position is None else 1
        turns, angle = divmod(position or 0, protocol.FULL_TURN)
        values = {"angle_rad": angle * protocol.RAD_PER_COUNT}
        if self._multi_turn:
            values["turns"] = float(protocol.signed(turns))
        return Batch(
            {name: np.full(count, value) for name, value in values.items()},
            np.full(count, self._transport.now_s),
            "host",
            np.full(count, self._schedule.asked - 1, np.int64),
            np.zeros(count, np.uint8),
            self._schedule.lost,
        )

    def _ask(self, turns: bool) -> int | None:
        """Return the answer's value, None when no good one comes in `TRIES` questions."""
        for attempt in range(TRIES):
            if attempt:
                self._counters.retries += 1
            self._discard(self._transport.read(0.0))
            self._transport.write(self._requests[turns])
            reply = self._receive(self._requests[turns])
            if not reply:
                continue
            try:
                return protocol.decode_reply(reply)
            except FrameError:
                self._counters.crc_errors += 1
                self._discard(reply)
        self._counters.timeouts += 1
        return None

    def _receive(self, request: bytes) -> bytes:
        """Return the answer, without the request where the adapter returns it."""
        give_up_s = self._transport.now_s + self._reply_timeout_s
        came = b""
        while len(came) < protocol.REPLY_SIZE:
            remaining_s = give_up_s - self._transport.now_s
            if remaining_s <= 0:
                break
            came += self._transport.read(remaining_s)
        came += self._transport.read(0.0)
        if len(came) == protocol.REPLY_SIZE + 1 and came.startswith(request):
            self._discard(came[:1])
            return came[1:]
        return came

    def _discard(self, data: bytes) -> None:
        self._counters.discarded_bytes += len(data)


def open_amt21(
    url: str,
    address: Annotated[int, Field(ge=0, le=252, multiple_of=4)] = protocol.DEFAULT_ADDRESS,
    multi_turn: bool = False,
    rate_hz: RateOption = 200.0,
    baud_rate: BaudOption = 2_000_000,
    top_speed_rad_s: Annotated[float, Field(gt=0)] = TOP_SPEED_RAD_S,
) -> Amt21:
    """Open the encoder on a serial adapter.

    Args:
        url: The adapter.
        address: The encoder's address, a multiple of 4.
        multi_turn: Whether the encoder also counts turns.
        rate_hz: How often it is asked.
        baud_rate: 2 Mbit/s for types A to D; types E to H are set to 9600 to 115200.
        top_speed_rad_s: The fastest the shaft turns, by which damaged readings are found.

    Raises:
        LinkError: The adapter cannot be opened, or the options are no encoder's.
    """
    try:
        line = open_line(url, baud_rate)
        return Amt21(line, address, multi_turn, rate_hz, top_speed_rad_s=top_speed_rad_s)
    except ValueError as error:
        raise LinkError(f"No AMT21 can be asked so: {error}.") from error


DRIVER = Driver("amt21", "Same Sky AMT21 absolute encoder, RS-485", open_amt21)
