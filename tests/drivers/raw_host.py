"""A host that sends what a test asks for to a board in virtual time, and a scripted bench."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.framing import FrameStream, encode_frame
from drivers.teensy import protocol
from drivers.teensy.core import TICK
from drivers.teensy.grasper import GRASPER, GrasperLimits
from drivers.teensy.profile import ArmLimits, Profile
from drivers.teensy.protocol import Kind, Result, TripReport
from drivers.teensy.reference import REFERENCE, Limits
from drivers.transport.simulated import Board

GAINS = np.array([20.0, 0.05, -1.0, 0.2, 10000.0])


class RawHost:
    """Sends frames and keeps samples; each method returns the answer's content."""

    def __init__(self, board: Board, profile: Profile = REFERENCE, gains: Any = GAINS) -> None:
        self.board = board
        self.profile = profile
        self.gains = np.atleast_2d(gains)
        self.session = 0
        self.number = 0
        self._stream = FrameStream(profile.sample.itemsize)
        self._samples: list[NDArray[Any]] = []

    def next_number(self) -> int:
        self.number = (self.number + 1) % 2**16
        return self.number

    def send(self, payload: bytes) -> list[bytes]:
        """Hand a frame to the board and return all payloads that are no samples."""
        self.board.receive(encode_frame(payload))
        return self._take()

    def run(self, ticks: int) -> None:
        self.board.advance(ticks)
        self._take()

    def samples(self) -> NDArray[np.void]:
        if not self._samples:
            return np.empty(0, self.profile.sample)
        return np.concatenate(self._samples)

    @property
    def armed(self) -> bool:
        return bool(self.hello().status & protocol.STATUS_ARMED)

    def ack(self, payload: bytes) -> tuple[Result, int]:
        """Send a command and return its result and the board's state."""
        (answer,) = self.send(payload)
        fields = self.profile.decode(answer)[2]
        ack = protocol.decode_ack(fields)
        return Result(ack.result), ack.status

    def hello(self) -> protocol.Identity:
        (answer,) = self.send(protocol.encode(Kind.HELLO, self.next_number()))
        return protocol.decode_identity(self.profile.decode(answer)[2])

    def command(self, kind: Kind) -> Result:
        return self.ack(protocol.encode(kind, self.next_number()))[0]

    def arm_payload(self, limits: ArmLimits | None = None, session: int | None = None) -> bytes:
        if session is None:
            session = self.hello().offer
        self.session = session
        limits = limits or (GrasperLimits() if self.profile is GRASPER else Limits())
        return self.profile.encode_arm(self.next_number(), self.gains, limits, session)

    def arm(self, limits: ArmLimits | None = None) -> Result:
        return self.ack(self.arm_payload(limits))[0]

    def setpoints_payload(self, *columns: Sequence[int], number: int | None = None) -> bytes:
        number = self.next_number() if number is None else number
        arrays = [np.array(column) for column in columns]
        return self.profile.encode_setpoints(number, arrays, self.session)

    def setpoints(self, *columns: Sequence[int]) -> Result:
        return self.ack(self.setpoints_payload(*columns))[0]

    def ping(self, session: int | None = None) -> None:
        session = self.session if session is None else session
        number = self.next_number()
        self.send(protocol.encode(Kind.PING, number, session, number))

    def clear(self, code: int) -> Result:
        return self.ack(protocol.encode(Kind.CLEAR, self.next_number(), code))[0]

    def trip(self) -> TripReport:
        (answer,) = self.send(protocol.encode(Kind.TRIP, self.next_number()))
        return self.profile.decode_trip_report(self.profile.decode(answer)[2])

    def _take(self) -> list[bytes]:
        frames = self._stream.feed(self.board.transmit())
        assert frames.bad == 0
        if len(frames.payloads):
            self._samples.append(frames.payloads.view(self.profile.sample)[:, 0])
        return list(frames.others)


class ScriptedBench:
    """No physics: the inputs of each tick, shape (n, channels), are given; the last ones stay."""

    def __init__(self, inputs: NDArray[np.int32], outputs: int = 2, tick_us: int = 1000) -> None:
        self._inputs = np.ascontiguousarray(inputs, np.int32)
        self._outputs = np.zeros(outputs, np.int32)
        self._tick_us, self._ticks = tick_us, 0

    def advance_with_board(
        self, ticks: int, tick_address: int, board_address: int, tick_us: int
    ) -> None:
        tick = TICK(tick_address)
        for k in range(ticks):
            inputs = self._inputs[min(self._ticks, len(self._inputs) - 1)]
            clock_us = (tick_us + self._tick_us * k) % 2**32
            tick(board_address, clock_us, inputs.ctypes.data, self._outputs.ctypes.data)
            self._ticks += 1
