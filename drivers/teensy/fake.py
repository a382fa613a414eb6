"""The logger board without a board: it takes and gives the bytes a real one would.

The bench behind it is physics; this file is the board's logic, block by block instead of tick by
tick: between two commands everything but a limit is known ahead, so one call of the bench and one
bulk encode do for as many ticks. `firmware/core/board.hpp` is the twin that runs tick by tick; a
test holds the two against each other byte for byte.

Not modelled: the time bytes take on the wire, jitter of the 1 kHz timer, and a crystal that is off.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.errors import FrameError
from drivers.framing import FrameStream, encode_frame, encode_frames
from drivers.teensy import protocol
from drivers.teensy.control import LIMIT, VELOCITY_FILTER
from drivers.teensy.guard import (
    CURRENT,
    ENGAGED,
    FSR,
    LOAD_MA,
    NO_CHANNEL,
    PROXIMAL,
    SILENT_US,
    STATE,
    STATUS,
    TARGET,
    TICKS,
    TRIP_CHANNEL,
    TRIP_CODE,
    TRIP_LATE_US,
    TRIP_LIMIT,
    TRIP_TICK,
    TRIP_VALUE,
    Drive,
)
from drivers.teensy.protocol import (
    SAMPLE_DTYPE,
    STATUS_ARMED,
    STATUS_HOLDING,
    STATUS_LIMIT_TRIPPED,
    STATUS_QUEUE_DRY,
    STATUS_SATURATED,
    STATUS_WATCHDOG_TRIPPED,
    TICK_US,
    TRIP_SHIFT,
    Ack,
    Kind,
    Limits,
    Result,
)

MAX_GAIN = 1e6
FULL_SCALE_E4 = 10_000
INT16_MIN, INT16_MAX = -(2**15), 2**15 - 1
FSR_MAX = 4095
TRANSMIT_CAPACITY = 65536
"""Bytes the board holds for a host that does not read."""
SAMPLE_WIRE = SAMPLE_DTYPE.itemsize + 4
"""Bytes of a sample frame on the wire."""
_LATCHED = STATUS_WATCHDOG_TRIPPED | STATUS_LIMIT_TRIPPED | 0xFF << TRIP_SHIFT
_ONCE_ONLY = (Kind.ARM, Kind.START, Kind.SETPOINTS)
"""Commands that a repeat, sent because the answer was lost, must not carry out again."""


class Bench(Protocol):
    """The physics behind a board, in ticks of 1 ms."""

    def advance(
        self,
        ticks: int,
        target: NDArray[np.int32],
        load_ma: NDArray[np.int32],
        drive: Drive,
    ) -> NDArray[np.int32]:
        """Run closed-loop ticks and return the counts, shape (ticks, 11), int32.

        Within a tick: the inputs are sampled into a row, `drivers.teensy.guard.drive_tick` holds
        the limits and writes what the motors get behind them, the physics moves 1 ms. The result
        does not depend on how ticks are divided between calls.

        Args:
            ticks: Number of ticks.
            target: Target of the spindle, counts, shape (ticks,).
            load_ma: Current of the load motor, mA, shape (ticks,).
            drive: The board's state, gains and limits, changed in place.
        """
        ...


class TeensyFake:
    """A logger board on a bench, with the interface of `drivers.transport.simulated.Board`.

    Args:
        bench: The physics.
        serial: Serial number the board gives.
        start_tick_us: Device clock at the first tick.
        protocol_hash: Protocol the board claims to speak.
        build_hash: Build the board claims to be.
    """

    def __init__(
        self,
        bench: Bench,
        serial: str = "SIM-0001",
        start_tick_us: int = 0,
        protocol_hash: int = protocol.PROTOCOL_HASH,
        build_hash: int = 0,
    ) -> None:
        self._bench = bench
        self._serial = serial
        self._protocol_hash = protocol_hash
        self._build_hash = build_hash
        self._next_tick_us = start_tick_us
        self._stream = FrameStream(0)  # no command is frequent
        self._out = bytearray()
        self._dropped = 0
        self._streaming = False
        self._sequence = 0
        self._last_command: tuple[Kind, int, Result] | None = None
        self._host_heard = False
        self._last_host_us = 0
        self._now_us = 0
        self._drive = Drive()
        self._drive.guard[TRIP_CHANNEL] = NO_CHANNEL
        self._trip_us = 0
        self._targets = np.empty(0, np.int32)
        self._loads = np.empty(0, np.int32)
        self._held: tuple[int, int] | None = None

    def receive(self, data: bytes) -> None:
        """Take bytes from the host and carry out the commands they complete."""
        for payload in self._stream.feed(data).others:
            self._answer(payload)

    def transmit(self) -> bytes:
        """Give the bytes that wait for the host."""
        data = bytes(self._out)
        self._out.clear()
        return data

    def advance(self, ticks: int) -> None:
        """Let `ticks` milliseconds of board time pass."""
        while ticks > 0:
            if self._host_heard:
                self._last_host_us = self._next_tick_us
                self._host_heard = False
            block = min(ticks, self._ticks_to_watchdog())
            if block == 0:
                self._drive.guard[SILENT_US] = self._silent_us
                block = ticks
            self._run_block(block)
            ticks -= block

    @property
    def in_force(self) -> bool:
        """Whether the motors are, or may any moment be, given current."""
        return bool(self._state & (STATUS_ARMED | STATUS_HOLDING))

    def skip(self, ticks: int) -> None:
        """Let ticks pass that nobody ran: their samples are lost, their setpoints are played."""
        self._targets, self._loads = self._targets[ticks:], self._loads[ticks:]
        self._sequence = (self._sequence + ticks) % 2**32
        self._next_tick_us = (self._next_tick_us + ticks * TICK_US) % 2**32

    # commands

    def _answer(self, payload: bytes) -> None:
        """Carry out one command and queue its answer."""
        if len(payload) < protocol.HEADER_DTYPE.itemsize:
            return
        self._host_heard = True
        number, sequence = payload[1], int.from_bytes(payload[2:4], "little")
        try:
            kind, _, fields = protocol.decode(payload)
        except FrameError:
            self._acknowledge(number, sequence, _reason_of_refusal(payload))
            return
        if kind is Kind.HELLO:
            self._last_command = None
            reply = (self._serial, self._protocol_hash, self._build_hash)
            self._send(protocol.encode_hello_reply(sequence, *reply))
        elif kind is Kind.PING:
            self._send(protocol.encode_pong(sequence, int(fields["token"]), self._now_us))
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
        guard = self._drive.guard.tolist()
        return protocol.encode_trip_report(
            sequence,
            guard[TRIP_CODE],
            guard[TRIP_CHANNEL],
            guard[TRIP_VALUE],
            guard[TRIP_LIMIT],
            self._trip_us,
            guard[TRIP_LATE_US],
        )

    def _execute(self, kind: Kind, payload: bytes, fields: np.void) -> Result:
        if kind is Kind.ARM:
            return self._arm(fields)
        if kind is Kind.SETPOINTS:
            return self._take_setpoints(payload)
        if kind is Kind.START:
            self._sequence = 0
            self._streaming = True
        elif kind is Kind.STOP:
            self._streaming = False
        elif kind is Kind.DISARM:
            self._release()
        else:
            return Result.UNKNOWN_KIND
        return Result.OK

    def _arm(self, fields: np.void) -> Result:
        gains = np.array([fields[name] for name in protocol.GAIN_NAMES], np.float64)
        limits = Limits(*(int(fields[name]) for name in protocol.LIMIT_NAMES))
        if not (np.abs(gains) <= MAX_GAIN).all():  # NaN fails too
            return Result.BAD_VALUE
        if not (0 <= gains[VELOCITY_FILTER] <= 1 and 0 <= gains[LIMIT] <= FULL_SCALE_E4):
            return Result.BAD_VALUE
        if not limits.valid:
            return Result.BAD_VALUE
        self._release()
        self._drive = Drive.armed(gains, limits, engaged=False)
        self._drive.guard[TRIP_CHANNEL] = NO_CHANNEL
        self._trip_us = 0
        return Result.OK

    def _take_setpoints(self, payload: bytes) -> Result:
        if not self._armed:
            return Result.NOT_ARMED
        block = protocol.decode_setpoints(payload)
        targets = block["target"].astype(np.int32)
        loads = block["load_ma"].astype(np.int32)
        _, max_load_ma, _, _, low, high = self._drive.limits[:6].tolist()
        if (np.abs(loads) > max_load_ma).any() or (targets < low).any() or (targets > high).any():
            return Result.BAD_VALUE
        if len(block) > self._queue_free():
            return Result.QUEUE_FULL
        self._targets = np.concatenate((self._targets, targets))
        self._loads = np.concatenate((self._loads, loads))
        return Result.OK

    def _queue_free(self) -> int:
        return protocol.QUEUE_CAPACITY - len(self._targets)

    def _acknowledge(self, command: int, sequence: int, result: Result) -> None:
        ack = Ack(sequence, command, result, self._state, self._queue_free())
        self._send(protocol.encode_ack(ack))

    def _send(self, payload: bytes) -> None:
        frame = encode_frame(payload)
        if len(self._out) + len(frame) > TRANSMIT_CAPACITY:
            self._dropped = (self._dropped + 1) % 2**16
            return
        self._out += frame

    # time

    @property
    def _state(self) -> int:
        return int(self._drive.guard[STATE])

    @property
    def _armed(self) -> bool:
        return bool(self._state & STATUS_ARMED)

    @property
    def _silent_us(self) -> int:
        return (self._next_tick_us - self._last_host_us) % 2**32

    def _ticks_to_watchdog(self) -> int:
        """Return how many ticks may run before the one on which the watchdog trips."""
        if not self._armed:
            return 2**31
        patience_us = Limits(*self._drive.limits.tolist()).watchdog_us
        return max(0, (patience_us - self._silent_us) // TICK_US + 1)

    def _release(self) -> None:
        """Take the motors out of force and forget what was to be done; the latches stay."""
        self._drive.guard[STATE] &= _LATCHED
        self._forget()

    def _forget(self) -> None:
        self._targets = self._targets[:0]
        self._loads = self._loads[:0]
        self._held = None

    def _run_block(self, ticks: int) -> None:
        """Run ticks in which no command comes and the watchdog trips on the first if at all."""
        guard = self._drive.guard
        engaged = self._armed and (self._held is not None or len(self._targets) > 0)
        guard[ENGAGED] = engaged
        tripped, first_tick = int(guard[TRIP_CODE]), int(guard[TICKS])
        targets, loads, fed = self._play(ticks) if engaged else (*np.zeros((2, ticks), np.int32), 0)
        counts = self._bench.advance(ticks, targets, loads, self._drive)
        if guard[TRIP_CODE] != tripped:
            since_us = TICK_US * (int(guard[TRIP_TICK]) - first_tick)
            self._trip_us = (self._next_tick_us + since_us) % 2**32
        if not self._armed:
            self._forget()
        status = counts[:, STATUS].astype(np.uint16)
        dry = (status[fed:] & STATUS_ARMED) != 0
        status[fed:][dry] |= STATUS_QUEUE_DRY
        self._log(counts, status)

    def _play(self, ticks: int) -> tuple[NDArray[np.int32], NDArray[np.int32], int]:
        """Take the next setpoints from the queue, the last one held where it runs dry."""
        fed = min(ticks, len(self._targets))
        if fed:
            self._held = (int(self._targets[fed - 1]), int(self._loads[fed - 1]))
        assert self._held is not None  # noqa: S101
        targets = np.full(ticks, self._held[0], np.int32)
        loads = np.full(ticks, self._held[1], np.int32)
        targets[:fed], self._targets = self._targets[:fed], self._targets[fed:]
        loads[:fed], self._loads = self._loads[:fed], self._loads[fed:]
        return targets, loads, fed

    # samples

    def _log(self, counts: NDArray[np.int32], status: NDArray[np.uint16]) -> None:
        """Let the clock go on and queue the samples of a block."""
        ticks = len(counts)
        ticks_us = (self._next_tick_us + TICK_US * np.arange(ticks, dtype=np.int64)) % 2**32
        self._now_us = int(ticks_us[-1])
        self._next_tick_us = (self._now_us + TICK_US) % 2**32
        if not self._streaming:
            return
        fitting = min(ticks, (TRANSMIT_CAPACITY - len(self._out)) // SAMPLE_WIRE)
        samples = np.empty(fitting, SAMPLE_DTYPE)
        samples["version"] = protocol.VERSION
        samples["kind"] = Kind.SAMPLE
        samples["status"] = status[:fitting] | _saturation(counts[:fitting])
        samples["sequence"] = (self._sequence + np.arange(fitting, dtype=np.int64)) % 2**32
        samples["tick_us"] = ticks_us[:fitting]
        samples["target"] = counts[:fitting, TARGET]
        within = np.clip(counts[:fitting, : LOAD_MA + 1], _LOWEST, _HIGHEST)
        for column, name in enumerate(_COLUMNS):
            samples[name] = within[:, column]
        samples["dropped"] = self._dropped
        self._sequence = (self._sequence + ticks) % 2**32
        self._dropped = (self._dropped + ticks - fitting) % 2**16
        if fitting:
            self._out += encode_frames(samples.view(np.uint8).reshape(fitting, -1))


_COLUMNS = (
    "motor",
    "spindle",
    "jaw",
    "proximal",
    "distal",
    "current",
    "fsr",
    "command_e4",
    "load_ma",
)
_RANGES = [np.iinfo(SAMPLE_DTYPE[name]) for name in _COLUMNS]
_LOWEST = np.array([bounds.min for bounds in _RANGES])
_HIGHEST = np.array([bounds.max for bounds in _RANGES])


def _saturation(counts: NDArray[np.int32]) -> NDArray[np.uint16]:
    """Return the saturated bit of each row: any converter at its limit."""
    signed = counts[:, PROXIMAL : CURRENT + 1]
    saturated = ((signed <= INT16_MIN) | (signed >= INT16_MAX)).any(axis=1)
    saturated |= counts[:, FSR] >= FSR_MAX
    return np.where(saturated, STATUS_SATURATED, 0).astype(np.uint16)


def _reason_of_refusal(payload: bytes) -> Result:
    """Say why `protocol.decode` refused a frame with a header."""
    if payload[0] != protocol.VERSION:
        return Result.WRONG_VERSION
    if payload[1] not in [kind.value for kind in Kind if kind >= Kind.HELLO]:
        return Result.UNKNOWN_KIND
    return Result.WRONG_SIZE
