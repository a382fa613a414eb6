"""A plain simulated board: it takes and gives the bytes a real one would, and guards nothing.

For simulation without a compiler. It speaks the whole protocol, sessions and the watchdog
on the host's silence included, and follows setpoints; limits it takes and does not hold. The board
with guards is the compiled core (`drivers.teensy.core`).

The bench behind it is physics; between two commands everything is known ahead, so one call of the
bench and one bulk encode do for as many ticks. Its counts have their zeros from the start, and it
refuses REFERENCE.

Not modelled: the time bytes take on the wire, jitter of the 1 kHz timer, and a crystal that is off.
"""

from dataclasses import astuple, replace

import numpy as np
from numpy.typing import NDArray

from drivers.errors import FrameError
from drivers.framing import FrameStream, encode_frame, encode_frames
from drivers.teensy import protocol
from drivers.teensy.control import Controllers
from drivers.teensy.logic import REFERENCE_LOGIC, Bench, BoardLogic
from drivers.teensy.protocol import GAIN_NAMES, STATUS_ARMED, Ack, Identity, Kind, Result, Trip
from drivers.transport.simulated import Outbox

TRANSMIT_CAPACITY = 65536
"""Bytes the board holds for a host that does not read."""
FRAME_OVERHEAD = 4
"""Bytes of a sample frame on the wire beyond its payload."""
_ONCE_ONLY = (Kind.ARM, Kind.START, Kind.SETPOINTS)
"""Commands that a repeat, sent because the answer was lost, must not carry out again."""
_SILENT = protocol.STATUS_WATCHDOG_TRIPPED | Trip.HOST_SILENT << protocol.TRIP_SHIFT


class PythonBoard(Outbox):
    """A board on a bench, with the interface of `drivers.transport.simulated.Board`."""

    def __init__(
        self,
        bench: Bench,
        start_tick_us: int = 0,
        protocol_hash: int | None = None,
        logic: BoardLogic = REFERENCE_LOGIC,
    ) -> None:
        super().__init__()
        self._bench = bench
        self._logic = logic
        self._profile = logic.profile
        own_hash = self._profile.protocol_hash if protocol_hash is None else protocol_hash
        self._identity = Identity("SIM-0001", "", own_hash, boot=1)
        self._next_tick_us = start_tick_us
        self._stream = FrameStream(0)  # no command is frequent
        self._dropped = 0
        self._streaming = False
        self._sequence = 0
        self._last_command: tuple[Kind, int, Result] | None = None
        self._offers = 0
        self._session: int | None = None
        self._newest = 0
        self._last_host_us = 0
        self._watchdog_us = protocol.WATCHDOG_US
        self._now_us = 0
        self._state = 0
        self._controllers = self._idle = Controllers.idle(self._profile.motors)
        self._trip_us = 0
        self._silent_us = 0
        self._queued = np.empty((0, len(self._profile.setpoint_names)), np.int32)
        self._held: NDArray[np.int32] | None = None

    def receive(self, data: bytes) -> None:
        """Take bytes from the host and carry out the commands they complete."""
        for payload in self._stream.feed(data).others:
            self._answer(payload)

    def advance(self, ticks: int) -> None:
        """Let that many of the profile's ticks pass."""
        while ticks > 0:
            block = min(ticks, self._ticks_to_watchdog())
            if block == 0:
                self._trip_us = self._next_tick_us
                self._silent_us = (self._next_tick_us - self._last_host_us) % 2**32
                self._release()
                self._state = _SILENT
                block = ticks
            self._run_block(block)
            ticks -= block

    # commands

    def _answer(self, payload: bytes) -> None:
        if len(payload) < protocol.HEADER_DTYPE.itemsize:
            return
        number, sequence = payload[1], int.from_bytes(payload[2:4], "little")
        try:
            kind, _, fields = self._profile.decode(payload)
        except FrameError:
            self._acknowledge(number, sequence, _reason_of_refusal(payload))
            return
        if kind is Kind.HELLO:
            self._last_command = None  # another program, whose numbers begin anew
            now = replace(self._identity, status=self._status, offer=self._offer)
            self._send(_hello_reply(sequence, now))
        elif kind is Kind.PING:
            if self._is_live(int(fields["session"])) and self._is_new(sequence):
                self._hear(sequence)
            self._send(protocol.encode(Kind.PONG, sequence, fields["token"], self._now_us))
        elif kind is Kind.TRIP:
            self._send(self._trip_report(sequence))
        elif self._last_command is not None and self._last_command[:2] == (kind, sequence):
            self._acknowledge(kind, sequence, self._last_command[2])
        else:
            result = self._execute(kind, payload, fields)
            if kind in _ONCE_ONLY:
                self._last_command = (kind, sequence, result)
            self._acknowledge(kind, sequence, result)

    def _trip_report(self, sequence: int) -> bytes:
        value = min(self._silent_us, protocol.TOP)
        numbers = (value, self._watchdog_us, self._trip_us, self._silent_us)
        code = self._trip
        return protocol.encode(
            Kind.TRIP_REPORT, sequence, code, 255, *(numbers if code else (0, 0, 0, 0))
        )

    def _execute(self, kind: Kind, payload: bytes, fields: np.void) -> Result:
        if kind is Kind.ARM:
            return self._arm(fields)
        if kind is Kind.SETPOINTS:
            return self._take_setpoints(payload, fields)
        if kind is Kind.CLEAR:
            return self._clear(int(fields["code"]))
        if kind is Kind.START:
            self._sequence = 0
            self._streaming = True
        elif kind is Kind.STOP:
            self._streaming = False
        elif kind is Kind.DISARM:
            self._release()
            self._last_command = None
        else:
            return Result.UNKNOWN_KIND
        return Result.OK

    def _arm(self, fields: np.void) -> Result:
        session = int(fields["session"])
        if session != self._offer:
            return Result.WRONG_SESSION
        self._offers += 1  # an attempt spends it
        if self._trip:
            return Result.TRIPPED
        if self._armed:
            return Result.ALREADY_ARMED
        names = self._profile.arm.names or ()
        values = [fields[name] for name in names[len(protocol.SESSION_FIELDS) :]]
        split = self._profile.motors * len(GAIN_NAMES)
        gains = np.array(values[:split], np.float64).reshape(self._profile.motors, -1)
        patience_us = int(fields["watchdog_us"])
        if not protocol.MIN_WATCHDOG_US <= patience_us <= protocol.MAX_WATCHDOG_US:
            return Result.BAD_VALUE
        if not np.isfinite(gains).all():
            return Result.BAD_VALUE
        self._release()
        self._watchdog_us = patience_us
        self._session = session
        self._state = STATUS_ARMED
        self._controllers = Controllers.fresh(gains)
        self._hear(int(fields["sequence"]))
        return Result.OK

    def _take_setpoints(self, payload: bytes, fields: np.void) -> Result:
        sequence = int(fields["sequence"])
        if not self._armed:
            return Result.NOT_ARMED
        if not self._is_live(int(fields["session"])):
            return Result.WRONG_SESSION
        if not self._is_new(sequence):
            return Result.OLD_SEQUENCE
        block = self._profile.decode_setpoints(payload)
        if len(block) > self._queue_free():
            return Result.QUEUE_FULL
        columns = [block[name].astype(np.int32) for name in self._profile.setpoint_names]
        self._queued = np.concatenate((self._queued, np.stack(columns, axis=1)))
        self._hear(sequence)
        return Result.OK

    def _clear(self, code: int) -> Result:
        if self._armed:
            return Result.ALREADY_ARMED
        if code != self._trip:
            return Result.WRONG_TRIP
        self._release()
        self._state = 0
        return Result.OK

    @property
    def _offer(self) -> int:
        """The session the next arming needs; only that it changes matters in a simulation."""
        return 0x5E55_0000 + self._offers

    def _is_live(self, session: int) -> bool:
        return self._armed and session == self._session

    def _is_new(self, sequence: int) -> bool:
        return 0 < (sequence - self._newest) % 2**16 < 2**15

    def _hear(self, sequence: int) -> None:
        self._newest = sequence
        self._last_host_us = self._next_tick_us

    def _queue_free(self) -> int:
        return protocol.QUEUE_CAPACITY - len(self._queued)

    def _acknowledge(self, command: int, sequence: int, result: Result) -> None:
        ack = Ack(sequence, command, result, self._status, self._queue_free())
        self._send(protocol.encode(Kind.ACK, *astuple(ack)))

    def _send(self, payload: bytes) -> None:
        frame = encode_frame(payload)
        if len(self._out) + len(frame) > TRANSMIT_CAPACITY:
            self._dropped = (self._dropped + 1) % 2**16
            return
        self._out += frame

    # time

    @property
    def _status(self) -> int:
        """The state as the host gets it: a simulated rig's counters are absolute."""
        return self._state | protocol.STATUS_REFERENCED

    @property
    def _trip(self) -> int:
        return self._state >> protocol.TRIP_SHIFT

    @property
    def _armed(self) -> bool:
        return bool(self._state & STATUS_ARMED)

    def _ticks_to_watchdog(self) -> int:
        """Return how many ticks may run before the one on which the watchdog trips."""
        if not self._armed:
            return 2**31
        silent_us = (self._next_tick_us - self._last_host_us) % 2**32
        return max(0, (self._watchdog_us - silent_us) // self._profile.tick_us + 1)

    def _release(self) -> None:
        """Take the motors out of force and forget what was to be done; a trip stays."""
        self._state &= ~STATUS_ARMED
        self._session = None
        self._queued = self._queued[:0]
        self._held = None

    def _run_block(self, ticks: int) -> None:
        """Run ticks in which no command comes and the watchdog does not trip."""
        engaged = self._armed and (self._held is not None or len(self._queued) > 0)
        setpoints, fed = self._play(ticks, engaged)
        controllers = self._controllers if engaged else self._idle
        counts = self._bench.advance(setpoints, controllers)
        status = np.full(ticks, self._status, np.uint16)
        if self._armed:
            status[fed:] |= protocol.STATUS_QUEUE_DRY
        self._log(counts, setpoints if engaged else None, status)

    def _play(self, ticks: int, engaged: bool) -> tuple[NDArray[np.int32], int]:
        """Take the next setpoints from the queue, the last one held where it runs dry."""
        fed = min(ticks, len(self._queued)) if engaged else 0
        if fed:
            self._held = self._queued[fed - 1]
        setpoints = np.zeros((ticks, self._queued.shape[1]), np.int32)
        if engaged and self._held is not None:
            setpoints[fed:] = self._held
        setpoints[:fed], self._queued = self._queued[:fed], self._queued[fed:]
        return setpoints, fed

    # samples

    def _log(
        self,
        counts: NDArray[np.int32],
        setpoints: NDArray[np.int32] | None,
        status: NDArray[np.uint16],
    ) -> None:
        ticks = len(counts)
        tick_us = self._profile.tick_us
        ticks_us = (self._next_tick_us + tick_us * np.arange(ticks, dtype=np.int64)) % 2**32
        self._now_us = int(ticks_us[-1])
        self._next_tick_us = (self._now_us + tick_us) % 2**32
        if not self._streaming:
            return
        on_wire = self._profile.sample.itemsize + FRAME_OVERHEAD
        fitting = min(ticks, (TRANSMIT_CAPACITY - len(self._out)) // on_wire)
        asked = None if setpoints is None else setpoints[:fitting]
        samples = self._logic.samples(counts[:fitting], asked)
        saturated = self._logic.saturated(counts[:fitting])
        samples["version"] = protocol.VERSION
        samples["kind"] = Kind.SAMPLE
        samples["status"] = status[:fitting]
        samples["status"][saturated] |= np.uint16(protocol.STATUS_SATURATED)
        samples["sequence"] = (self._sequence + np.arange(fitting, dtype=np.int64)) % 2**32
        samples["tick_us"] = ticks_us[:fitting]
        samples["dropped"] = self._dropped
        self._sequence = (self._sequence + ticks) % 2**32
        self._dropped = (self._dropped + ticks - fitting) % 2**16
        if fitting:
            self._out += encode_frames(samples.view(np.uint8).reshape(fitting, -1))


def _hello_reply(sequence: int, identity: Identity) -> bytes:
    numbers = (identity.protocol_hash, protocol.FIRMWARE_VERSION, identity.build_hash)
    state = (identity.serial.encode(), identity.boot, identity.status, identity.offer)
    return protocol.encode(Kind.HELLO_REPLY, sequence, *numbers, *state)


def _reason_of_refusal(payload: bytes) -> Result:
    if payload[0] != protocol.VERSION:
        return Result.WRONG_VERSION
    if payload[1] not in [kind.value for kind in Kind if kind >= Kind.HELLO]:
        return Result.UNKNOWN_KIND
    return Result.WRONG_SIZE
