"""A session with the rig: connected devices, limits checked at every sample, safe on every way out.

The session streams from start to end. `rest` reads the disarmed rig; `play` arms it and plays a
trajectory. Whatever ends the session (the end, an error, Ctrl-C, SIGTERM), the logger is disarmed
first, and the disarming is confirmed by the logger itself.
"""

import signal
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from types import FrameType, TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from calibration.zero import SensorZero, measure_zeros
from drivers.clock import ClockFit
from drivers.errors import DriverError
from drivers.teensy.driver import SampleBatch, TeensyLogger
from drivers.teensy.protocol import (
    MAX_SETPOINTS,
    STATUS_ARMED,
    STATUS_LIMIT_TRIPPED,
    STATUS_QUEUE_DRY,
    STATUS_SATURATED,
    STATUS_WATCHDOG_TRIPPED,
    TICK_US,
    Identity,
    Limits,
)
from drivers.transport.transport import Transport
from estimation.recording import Flag
from rig.config import Config
from rig.errors import RigError, SafetyTripError
from rig.motion import settling

LEAD_S = 0.3
"""Setpoints are kept this far ahead of the rig, s: longer than any pause of the host."""

TICKS_A_SECOND = 1_000_000 // TICK_US

READ_TIMEOUT_S = 0.2
"""Longest wait for the next samples, s; shorter than the logger's watchdog, fed in between."""

STALL_S = 1.0
"""With no sample for this long, the logger is taken for dead, s."""


class LoggerStalledError(RigError):
    """The logger sends nothing although it should stream at 1 kHz."""


@dataclass(frozen=True, eq=False)
class Reading:
    """A stretch of samples, as counts and in SI.

    Attributes:
        counts: Raw samples, structured, shape (n,).
        tick_us: Device clock without its wrap, us, shape (n,).
        time_s: Device clock since the session's first sample, s, shape (n,).
        columns: SI channels, closing-positive, each of shape (n,).
        flags: `Flag` bits, shape (n,).
        setpoint: Index of the setpoint played in each sample, -1 where none was, shape (n,).
        lost: Samples lost since the session began.
    """

    counts: NDArray[np.void]
    tick_us: NDArray[np.int64]
    time_s: NDArray[np.float64]
    columns: Mapping[str, NDArray[np.float64]]
    flags: NDArray[np.uint8]
    setpoint: NDArray[np.int64]
    lost: int

    @property
    def armed(self) -> bool:
        """Whether the logger was armed in the newest sample."""
        return bool(_has(self.counts["status"], STATUS_ARMED)[-1])

    def __len__(self) -> int:
        return int(self.time_s.size)

    def where(self, keep: NDArray[np.bool_]) -> "Reading":
        """Return the samples a mask keeps."""
        return Reading(
            self.counts[keep],
            self.tick_us[keep],
            self.time_s[keep],
            {name: values[keep] for name, values in self.columns.items()},
            self.flags[keep],
            self.setpoint[keep],
            self.lost,
        )


class Session:
    """A connected rig.

    Use as a context manager. Reading is driven by the caller: nothing runs in the background, so
    on a simulated transport a session is exactly repeatable.
    """

    def __init__(self, config: Config, transport: Transport) -> None:
        self.config = config
        self.calibrations: CalibrationSet = config.calibration_set()
        self.zeros: dict[str, float] = {}
        self.identity: Identity
        self._logger = TeensyLogger(transport)
        self._transport = transport
        self._ways_out = ExitStack()
        self._first_tick_us: int | None = None
        self._spindle_angle_rad = 0.0
        self.newest_tick_us = 0
        self.clock = ClockFit()
        """The logger's clock against this computer's; its line states the residual of the fit."""

    def __enter__(self) -> Self:
        with ExitStack() as ways_out:
            ways_out.callback(self._logger.close)
            self.identity = self._logger.identify()
            ways_out.callback(self._stop_streaming)
            ways_out.enter_context(_sigterm_as_interrupt())
            self._logger.start()
            self._ways_out = ways_out.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ways_out.__exit__(kind, error, trace)

    @property
    def counters(self) -> Mapping[str, int]:
        """The link's counters: frames, CRC errors, gaps, lost samples, discarded bytes, retries."""
        return self._logger.counters.as_dict()

    @property
    def spindle_angle_rad(self) -> float:
        """Where the spindle stood in the newest sample, rad."""
        return self._spindle_angle_rad

    def safe(self) -> None:
        """Disarm: command 0, load 0, confirmed by the logger.

        Raises:
            DriverError: The logger did not confirm; cut the power by hand.
        """
        self._logger.disarm()

    def rest(self, duration_s: float) -> Iterator[Reading]:
        """Read the disarmed rig for a while."""
        self.safe()
        remaining = round(duration_s * TICKS_A_SECOND)
        while remaining > 0:
            reading = self._read()
            remaining -= len(reading.time_s)
            yield reading

    def take_zeros(self, duration_s: float) -> dict[str, SensorZero]:
        """Measure the zeros of the disarmed rig and use them from now on.

        Raises:
            CalibrationError: Too few samples came.
        """
        counts = np.concatenate([reading.counts for reading in self.rest(duration_s)])
        zeros = measure_zeros(counts, self.calibrations)
        self.zeros = {name: zero.mean_counts for name, zero in zeros.items()}
        return zeros

    def watch(self) -> Iterator[Reading]:
        """Read the rig as it is, without arming or moving it, until the caller stops."""
        while True:
            yield self._read()

    def play(
        self, target_angle_rad: NDArray[np.float64], load_command_a: NDArray[np.float64]
    ) -> Iterator[Reading]:
        """Arm the rig and play a trajectory; each sample says which setpoint it played.

        Args:
            target_angle_rad: Spindle trajectory at 1 kHz, closing-positive, shape (n,).
            load_command_a: Load motor current, shape (n,).

        Raises:
            SafetyTripError: A limit was crossed; the rig is disarmed.
            LoggerStalledError: The logger fell silent; the rig's own watchdog makes it safe.
        """
        targets = self._to_counts("target_angle_rad", target_angle_rad)
        loads_ma = self._to_counts("load_command_a", load_command_a)
        self._check_setpoints(target_angle_rad, load_command_a)
        lead = round(LEAD_S * TICKS_A_SECOND)
        self._logger.arm(self.config.controller.gains(), self._board_limits())
        queued = played = 0
        while played < targets.size:
            while queued < min(played + lead, targets.size):
                block = slice(queued, min(queued + MAX_SETPOINTS, targets.size))
                self._logger.queue(targets[block], loads_ma[block])
                queued = block.stop
            reading = self._read()
            self._check_board(reading)
            reading = _number(reading, played)
            played = max(played, int(reading.setpoint.max()) + 1)
            yield reading

    def settle(self) -> None:
        """Move the unloaded rig a little, so that friction gives up the torque it holds."""
        motion = settling(self.spindle_angle_rad)
        for _ in self.play(motion.target_angle_rad, motion.load_command_a):
            pass

    def _read(self) -> Reading:
        self._logger.heartbeat()
        give_up_s = self._transport.now_s + STALL_S
        while True:
            batch = self._logger.read(READ_TIMEOUT_S)
            if len(batch.samples):
                break
            if self._transport.now_s > give_up_s:
                raise LoggerStalledError(
                    f"The logger has sent nothing for {STALL_S:g} s.",
                    "Its cable was pulled, it was reset, or its program stopped.",
                    "Check the cable and its supply, then start again; nothing recorded is lost.",
                )
        self._follow_clock()
        reading = self._convert(batch)
        self.newest_tick_us = int(reading.tick_us[-1])
        self._spindle_angle_rad = float(reading.columns["spindle_angle_rad"][-1])
        self._check_limits(reading)
        return reading

    def _follow_clock(self) -> None:
        exchange = self._logger.last_exchange
        if exchange is not None:
            self.clock.add(exchange.sent_s, exchange.received_s, exchange.tick_us)

    def _convert(self, batch: SampleBatch) -> Reading:
        if self._first_tick_us is None:
            self._first_tick_us = int(batch.tick_us[0])
        status = batch.samples["status"]
        flags = np.zeros(len(status), np.uint8)
        flags[_has(status, STATUS_SATURATED)] |= np.uint8(Flag.SATURATED)
        flags[_has(status, STATUS_WATCHDOG_TRIPPED | STATUS_LIMIT_TRIPPED)] |= np.uint8(
            Flag.SUSPECT
        )
        flags[_has(status, STATUS_ARMED) & _has(status, STATUS_QUEUE_DRY)] |= np.uint8(Flag.STALE)
        return Reading(
            batch.samples,
            batch.tick_us,
            np.multiply(batch.tick_us - self._first_tick_us, 1e-6),
            self.calibrations.apply(batch.samples, self.zeros),
            flags,
            np.full(len(flags), -1),
            batch.lost,
        )

    def _to_counts(self, channel: str, values: NDArray[np.float64]) -> NDArray[np.int32]:
        line = self.calibrations.channels[channel]
        return np.round(values / line.slope + line.zero_counts).astype(np.int32)

    def _board_limits(self) -> Limits:
        """Return the limits the board checks itself, in its own counts."""
        limits = self.config.limits
        low, high = sorted(
            self._to_counts("spindle_angle_rad", np.array([-1.0, 1.0]) * limits.spindle_angle_rad)
        )
        return Limits(
            max_current=self._size("motor_current_a", limits.motor_current_a),
            max_load_ma=self._size("load_command_a", limits.load_command_a),
            max_proximal=self._size("proximal_torque_n_m", limits.proximal_torque_n_m),
            max_distal=self._size("distal_torque_n_m", limits.distal_torque_n_m),
            min_spindle=int(low),
            max_spindle=int(high),
        )

    def _size(self, channel: str, value: float) -> int:
        """Return a size in SI as counts, zeros left aside."""
        return round(abs(value / self.calibrations.channels[channel].slope))

    def _check_setpoints(
        self, target_angle_rad: NDArray[np.float64], load_command_a: NDArray[np.float64]
    ) -> None:
        limits = self.config.limits
        for name, values, limit in (
            ("spindle_angle_rad", target_angle_rad, limits.spindle_angle_rad),
            ("load_command_a", load_command_a, limits.load_command_a),
        ):
            if not np.isfinite(values).all() or np.abs(values).max(initial=0.0) > limit:
                raise SafetyTripError(
                    f"The trajectory asks for {name} = {np.abs(values).max():.3g}.",
                    f"The configured limit is {limit:g}; nothing was moved.",
                    f"Change the protocol, or [limits] {name} if the rig can take it.",
                )

    def _check_limits(self, reading: Reading) -> None:
        for name, limit in self.config.limits.model_dump().items():
            values = reading.columns.get(name)
            if values is None or values.size == 0:
                continue
            worst = float(np.abs(values).max())
            if worst > limit:
                self.safe()
                raise SafetyTripError(
                    f"{name} reached {worst:.3g}, the limit is {limit:g}.",
                    f"At {reading.time_s[int(np.abs(values).argmax())]:.3f} s of the session;"
                    " the rig is disarmed.",
                    "Find out what the jaw met before going on; limits stand under [limits].",
                )

    def _check_board(self, reading: Reading) -> None:
        status = int(np.bitwise_or.reduce(reading.counts["status"]))
        for bit, what, why in (
            (STATUS_LIMIT_TRIPPED, "The logger tripped one of its own limits.", ""),
            (
                STATUS_WATCHDOG_TRIPPED,
                "The logger's watchdog tripped.",
                "It heard nothing from this computer for 250 ms while armed.",
            ),
        ):
            if status & bit:
                raise SafetyTripError(what, why, "The rig is in its safe state until armed again.")

    def _stop_streaming(self) -> None:
        try:
            self.safe()
        except DriverError as error:
            raise SafetyTripError(
                "The rig did not confirm that it is disarmed.",
                error.what,
                "Cut the motor supply by hand and look at the rig.",
            ) from error
        finally:
            self._logger.stop()


def _has(status: NDArray[np.uint16], bits: int) -> NDArray[np.bool_]:
    present: NDArray[np.bool_] = (status & np.uint16(bits)) != 0
    return present


def _number(reading: Reading, played: int) -> Reading:
    """Number the setpoints of a reading, `played` being the first one not played yet.

    The logger plays one setpoint a tick and none in a tick in which its queue is dry. Lost samples
    are taken to have played theirs: the sequence numbers say how many there were.
    """
    dry = _has(reading.counts["status"], STATUS_QUEUE_DRY)
    step = np.diff(reading.counts["sequence"].astype(np.int64), prepend=0)
    step[0] = 1
    setpoint = played - 1 + np.cumsum(np.where(dry, 0, step))
    return replace(reading, setpoint=np.where(dry, -1, setpoint))


@contextmanager
def _sigterm_as_interrupt() -> Iterator[None]:
    """Turn SIGTERM into KeyboardInterrupt, so that it takes the same way out as Ctrl-C."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    try:
        previous = signal.signal(signal.SIGTERM, interrupt)
    except ValueError:  # not in the main thread, where signals never arrive
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)
