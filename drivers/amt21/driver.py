"""The driver of an AMT21: it is polled for every sample, at a steady rate."""

import math
from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from drivers.amt21 import protocol
from drivers.counters import silent
from drivers.device import Channel, DeviceIdentity
from drivers.errors import FrameError, LinkTimeoutError
from drivers.polling import PolledDevice
from drivers.registry import Driver, RateOption, opener
from drivers.transport.transport import Transport, arriving

REPLY_TIMEOUT_S = 0.01
"""Time for an answer: on a USB adapter it takes some milliseconds."""

TOP_SPEED_RAD_S = 8000 * 2 * math.pi / 60
"""The fastest shaft of the series: 8000 turns a minute for the 12-bit types, 4000 for 14 bits."""
_PLAY_COUNTS = 4
"""Counts a shaft at rest may differ by from one reading to the next."""


def turns_at(angle: int, before: int, after: int) -> int | None:
    """Return the turns that go with an angle, from the turns asked before and after it.

    The shaft has moved less than half a turn in between: where the turns differ by one, the angle
    says by its half of the turn on which side of the wrap it was read. All are 14-bit values; the
    result is None when the turns are further apart than one.
    """
    step = (after - before) % protocol.FULL_TURN
    if step == 0:
        return before
    in_lower_half = angle < protocol.FULL_TURN // 2
    if step == 1:
        return after if in_lower_half else before
    if step == protocol.FULL_TURN - 1:
        return before if in_lower_half else after
    return None


class Amt21(PolledDevice):
    """One encoder on an RS-485 line. Nothing else on the line may be asked at the same time.

    Args:
        address: The encoder's address.
        multi_turn: Whether it also counts turns.
        rate_hz: Polling rate. A request without an answer is a gap in `sequence`.
        top_speed_rad_s: The fastest the shaft turns; a reading that would need more is damaged.
    """

    name = "amt21"

    def __init__(
        self,
        transport: Transport,
        address: Annotated[int, Field(ge=0, le=252, multiple_of=4)] = protocol.DEFAULT_ADDRESS,
        multi_turn: bool = False,
        rate_hz: RateOption = 200.0,
        top_speed_rad_s: Annotated[float, Field(gt=0)] = TOP_SPEED_RAD_S,
    ) -> None:
        super().__init__(transport, rate_hz)
        self._transport = transport
        self._requests = [protocol.request(address, turns) for turns in (False, True)]
        self._address = address
        self._multi_turn = multi_turn
        self._identified = True  # it has nothing to be identified by but an answer
        self._counts_a_second = top_speed_rad_s / protocol.RAD_PER_COUNT
        self._wrap = protocol.FULL_TURN * (protocol.FULL_TURN if multi_turn else 1)
        self._last: tuple[int, float] | None = None
        angle = Channel("angle_rad", "rad", rate_hz, 0.0, 2 * math.pi, "absolute angle, one turn")
        half = protocol.FULL_TURN // 2
        turns = Channel("turns", "1", rate_hz, -half, half - 1, "whole turns")
        self._channels = (angle, turns) if multi_turn else (angle,)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The angle, and the turns of a multi-turn encoder."""
        return self._channels

    def identify(self) -> DeviceIdentity:
        """Request one position: the encoder has no other identification."""
        if self._ask(turns=False) is None:
            where = f"{self._transport.url}, address {self._address:#04x}"
            check = (
                "Check supply, A and B, the address, and the bit rate (2 Mbit/s for types A to D)."
            )
            raise silent("AMT21", where, REPLY_TIMEOUT_S, check)
        return DeviceIdentity("AMT21", "", "")

    def start(self) -> None:
        """Number the samples from 0, the first being due now."""
        super().start()
        self._last = None

    def idle(self, wait_s: float) -> None:
        """Let time pass; what comes unasked is late, and dropped."""
        self._discard(self._transport.read(wait_s))

    def sample(self) -> tuple[Sequence[float], int]:
        """Ask for the position.

        Raises:
            LinkTimeoutError: Every position read is one that the shaft cannot have.
        """
        position = self._plausible()
        if position is None:
            raise LinkTimeoutError("The AMT21 gives no good position.")
        self._last = position, self._transport.now_s
        turns, angle = divmod(position, protocol.FULL_TURN)
        values = (angle * protocol.RAD_PER_COUNT, float(protocol.signed(turns)))
        return values[: len(self._channels)], 0

    def _plausible(self) -> int | None:
        """Return a position that the shaft can have, None without a good one.

        A position out of reach is asked for again: it was damaged, unless the second one agrees.
        Two check bits let one damaged answer in four pass.
        """
        first = self._measure()
        first_s = self._transport.now_s
        if first is None or self._fits(first, first_s):
            return first
        self._counters.crc_errors += 1
        self._counters.retries += 1
        second = self._measure()
        if second is None:
            return None
        now_s = self._transport.now_s
        if self._fits(second, now_s) or self._is_near(second, first, now_s - first_s):
            return second
        self._counters.crc_errors += 1
        self._counters.timeouts += 1
        return None

    def _fits(self, position: int, now_s: float) -> bool:
        return self._last is None or self._is_near(position, self._last[0], now_s - self._last[1])

    def _is_near(self, position: int, other: int, apart_s: float) -> bool:
        """Return whether the shaft can have turned from one position to the other in that time."""
        half = self._wrap // 2
        moved = abs((position - other + half) % self._wrap - half)
        return moved <= apart_s * self._counts_a_second + _PLAY_COUNTS

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

    def _ask(self, turns: bool) -> int | None:
        """Return the answer's value, None when no good one comes in `TRIES` questions."""
        for _ in self._counters.attempts():
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
        return None

    def _receive(self, request: bytes) -> bytes:
        """Return the answer, without the request where the adapter returns it."""
        came = b""
        for came in arriving(self._transport, REPLY_TIMEOUT_S):
            if len(came) >= protocol.REPLY_SIZE:
                break
        came += self._transport.read(0.0)
        if len(came) == protocol.REPLY_SIZE + 1 and came.startswith(request):
            self._discard(came[:1])
            return came[1:]
        return came

    def _discard(self, data: bytes) -> None:
        self._counters.discarded_bytes += len(data)


DRIVER = Driver(
    "amt21",
    "Same Sky AMT21 absolute encoder, RS-485",
    opener(Amt21, "AMT21", baud_rate=2_000_000),
)
"""The bit rate is that of types A to D; types E to H are set to 9600 to 115200."""
