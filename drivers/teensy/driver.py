"""The driver of the Teensy logger: the same for the board on the bench and for its fakes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from drivers.errors import CommandRefusedError, DisarmUnconfirmedError, DriverError, FrameError
from drivers.link import Continuity, FramedLink
from drivers.teensy import protocol
from drivers.teensy.profile import ArmLimits, Profile
from drivers.teensy.protocol import Ack, Identity, Kind, Result, TripReport
from drivers.teensy.reference import REFERENCE
from drivers.teensy.refusals import other_layout, other_protocol, refused
from drivers.transport.transport import Transport


@dataclass(frozen=True, slots=True, eq=False)
class SampleBatch:
    """Samples in device order."""

    samples: NDArray[np.void]  # `SAMPLE_DTYPE`, shape (n,); raw counts
    # device clock without its wrap, microseconds since its last zero, shape (n,), int64
    tick_us: NDArray[np.int64]
    # Samples lost since `start`, up to the end of this batch. None is made up for.
    lost: int


@dataclass(frozen=True, slots=True)
class ClockExchange:
    """The board's clock, us modulo 2^32, between two times of the host's: ping sent, pong read."""

    sent_s: float
    received_s: float
    tick_us: int


class TeensyLogger:
    """The logger on the other end of a transport. Nothing runs in the background.

    While armed, the board needs a block of setpoints or a `heartbeat` within the time it was armed
    with; otherwise it goes to its safe state.
    """

    def __init__(self, transport: Transport, profile: Profile = REFERENCE) -> None:
        self._profile = profile
        self._link = FramedLink(transport, profile.sample.itemsize)
        self.counters = self._link.counters
        self._continuity = Continuity(self.counters)
        self._identity: Identity | None = None
        self._command_number = 0
        self._session = 0
        self._may_be_armed = False
        self._pings: dict[int, float] = {}
        self.last_exchange: ClockExchange | None = None
        self.queue_free = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def identify(self) -> Identity:
        """Read the board's identity and check its protocol version.

        Raises:
            ProtocolMismatchError: Its protocol differs; the message names both.
        """
        self._link.break_frame()
        hello = protocol.encode(Kind.HELLO, self._number())
        try:
            identity = protocol.decode_identity(self._request(Kind.HELLO_REPLY, hello))
        except FrameError as error:
            raise other_layout(self._link.transport.url, self._profile, str(error)) from error
        if identity.protocol_hash != self._profile.protocol_hash:
            raise other_protocol(self._link.transport.url, self._profile, identity)
        self._identity = identity
        return identity

    def arm(self, gains: Sequence[Any] | NDArray[np.float64], limits: ArmLimits) -> None:
        """Switch the controllers on. The motors stay currentless until the first setpoint.

        Only this logger can then move the board or keep it armed.

        Args:
            gains: `drivers.teensy.control`'s gains, shape (5,) or (motors, 5).
            limits: Limits that the board checks on every sample; of the profile's kind.

        Raises:
            CommandRefusedError: A gain or a limit is not finite or out of range, or the board
                tripped at once.
        """
        self._session = self.identify().offer
        values = np.atleast_2d(np.asarray(gains, np.float64))
        wanted = (self._profile.motors, len(protocol.GAIN_NAMES))
        if values.shape != wanted:
            raise DriverError(
                f"The controllers have {wanted[0]} x {wanted[1]} gains, not {values.shape}."
            )
        self._may_be_armed = True
        payload = self._profile.encode_arm(self._number(), values, limits, self._session)
        ack = self._command(Kind.ARM, payload)
        if not ack.status & protocol.STATUS_ARMED:
            raise CommandRefusedError(
                f"The board at {self._link.transport.url} was armed and is not any more.",
                "It tripped before its answer came through.",
                "Look at the status of its samples, then run: rig clear",
                Result.NOT_ARMED,
            )

    def clear(self, code: int) -> None:
        """Clear what the board tripped over first, by the code that was read; nothing is armed.

        Raises:
            CommandRefusedError: It is armed, or has tripped over something else.
        """
        self._require_identity()
        self._command(Kind.CLEAR, protocol.encode(Kind.CLEAR, self._number(), code))

    def reference(self, counts: Sequence[int], at_index: bool = False) -> None:
        """Give the encoders their counts; the board must be at rest.

        Args:
            counts: Of each encoder, in the order of a sample.
            at_index: Whether they are those of the place where the spindle's index came last, not
                of the present one.

        Raises:
            CommandRefusedError: The board is armed, a shaft is turning, or no index came.
        """
        self._require_identity()
        payload = protocol.encode(Kind.REFERENCE, self._number(), *counts, at_index)
        self._command(Kind.REFERENCE, payload)

    def start(self) -> None:
        """Start the stream of samples; their sequence numbers begin at 0."""
        self._require_identity()
        self.stop()  # what an earlier program left running
        self._link.take_stream()
        self._continuity.restart()
        self._simple(Kind.START)

    def stop(self) -> None:
        """Stop the stream of samples; those already sent can still be read."""
        self._simple(Kind.STOP)

    def queue(self, *columns: NDArray[np.integer]) -> int:
        """Queue setpoints behind those the board has; it plays one a tick and holds the last.

        Args:
            columns: The fields of a setpoint, in the profile's order, whole numbers, each of shape
                (n,): on the reference rig spindle targets in encoder counts, and the load motor's
                current in mA; on the grasper each motor's target.

        Returns:
            How many more setpoints the board had room for.

        Raises:
            CommandRefusedError: Not armed, the queue is full, or a setpoint is beyond the limits.
                Blocks of the profile's `max_setpoints` before the refused one were taken.
            DriverError: The arrays do not fit each other or the board's number range.
        """
        self._require_identity()
        whole = self._profile.whole_setpoints(columns)
        for first in range(0, whole[0].size, self._profile.max_setpoints):
            block = [values[first : first + self._profile.max_setpoints] for values in whole]
            payload = self._profile.encode_setpoints(self._number(), block, self._session)
            self._command(Kind.SETPOINTS, payload)
        return self.queue_free

    def read(self, timeout_s: float) -> SampleBatch:
        """Return the samples that have come, waiting at most `timeout_s` for the first."""
        give_up_s = self._link.transport.now_s + timeout_s
        while True:
            remaining_s = max(0.0, give_up_s - self._link.transport.now_s)
            if self._link.stream_waits:
                remaining_s = 0.0
            came = self._link.poll(remaining_s)
            self._take_replies()
            samples = self._known(self._link.take_stream().view(self._profile.sample)[:, 0])
            if len(samples) or not came or self._link.transport.now_s >= give_up_s:
                return SampleBatch(*self._continuity.follow(samples), self._continuity.lost)

    def heartbeat(self) -> None:
        """Send a sign of life to the board, and request its clock without waiting.

        The answer, once read, is `last_exchange`.
        """
        number = self._number()
        self._pings = dict(list(self._pings.items())[-7:])  # a lost pong is not waited for
        self._pings[number] = self._link.transport.now_s
        self._link.send(protocol.encode(Kind.PING, number, self._session, number))

    def disarm(self) -> None:
        """Take the motors out of force: command 0, load 0, the queue cleared.

        Works without `identify`. Returns only when the board has confirmed that it is disarmed.

        Raises:
            DisarmUnconfirmedError: It has not confirmed it; its state is unknown.
        """
        try:
            ack = self._simple(Kind.DISARM)
        except DriverError as error:
            raise self._unconfirmed(str(error)) from error
        if ack.status & protocol.STATUS_ARMED:
            raise self._unconfirmed("It answered that it is still armed.")
        self._may_be_armed = False

    def trip(self) -> TripReport:
        """Read the first limit crossed since the board was cleared."""
        question = protocol.encode(Kind.TRIP, self._number())
        return self._profile.decode_trip_report(self._request(Kind.TRIP_REPORT, question))

    def close(self) -> None:
        """Disarm where the board may be armed, and let go of the link.

        Raises:
            DisarmUnconfirmedError: The link is closed, but the board's state is unknown.
        """
        try:
            if self._may_be_armed:
                self.disarm()
        finally:
            self._link.transport.close()

    def _unconfirmed(self, why: str) -> DisarmUnconfirmedError:
        return DisarmUnconfirmedError(
            f"The board at {self._link.transport.url} has not confirmed that it is disarmed.",
            why,
            "Take the motor for live and cut its supply. A working board makes itself safe"
            f" {protocol.WATCHDOG_US // 1000} ms after the last received command.",
        )

    def _require_identity(self) -> None:
        if self._identity is None:
            self.identify()

    def _number(self) -> int:
        self._command_number = (self._command_number + 1) % 2**16
        return self._command_number

    def _simple(self, kind: Kind) -> Ack:
        return self._command(kind, protocol.encode(kind, self._number()))

    def _command(self, kind: Kind, payload: bytes) -> Ack:
        ack = protocol.decode_ack(self._request(Kind.ACK, payload))
        self.queue_free = ack.queue_free
        if ack.result != Result.OK:
            raise refused(self._link.transport.url, kind, ack.result)
        return ack

    def _request(self, expected: Kind, payload: bytes) -> np.void:
        """Send a command and return the fields of the answer with its number."""
        number = payload[2:4]
        answer = self._link.request(
            payload, lambda reply: reply[1:2] in (bytes([expected]), _ACK) and reply[2:4] == number
        )
        kind, _, fields = self._profile.decode(answer)
        if kind is not expected:
            raise FrameError(f"The answer is {kind.name}, not {expected.name}.")
        return fields

    def _take_replies(self) -> None:
        """Note the pongs; count unexpected frames. Late acknowledgements are of no use."""
        received_s = self._link.transport.now_s
        for payload in self._link.take_others():
            try:
                kind, number, fields = self._profile.decode(payload)
            except FrameError:
                self.counters.unknown_frames += 1
                continue
            if kind is Kind.PONG and number in self._pings:
                self.last_exchange = ClockExchange(
                    self._pings.pop(number), received_s, int(fields["tick_us"])
                )
            elif kind >= Kind.HELLO:
                self.counters.unknown_frames += 1

    def _known(self, samples: NDArray[np.void]) -> NDArray[np.void]:
        known = (samples["version"] == protocol.VERSION) & (samples["kind"] == Kind.SAMPLE)
        if known.all():
            return samples
        self.counters.unknown_frames += int(np.count_nonzero(~known))
        return np.asarray(samples[known])


_ACK = bytes([Kind.ACK])
