"""A session with the rig: connected devices, limits checked at every sample, safe on every way out.

The session streams from start to end. `rest` reads the disarmed rig; `play` arms it and plays a
trajectory. Whatever ends the session (the end, an error, Ctrl-C, SIGTERM), the logger is disarmed
first, and the disarming is confirmed by the logger itself.
"""

import signal
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from types import FrameType, TracebackType
from typing import Self

import numpy as np
from drivers.teensy.driver import Identity, SampleBatch, TeensyLogger
from drivers.transport.transport import Transport
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from drivers.errors import DriverError
from drivers.teensy import protocol as frames
from estimation.recording import Flag
from rig.config import Config
from rig.errors import RigError, SafetyTripError

LEAD_S = 0.3
"""Setpoints are kept this far ahead of the rig, s: longer than any pause of the host."""

BLOCK = 64
"""Setpoints sent in one frame."""

READ_TIMEOUT_S = 0.05

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
        lost: Samples lost since the session began.
    """

    counts: NDArray[np.void]
    tick_us: NDArray[np.int64]
    time_s: NDArray[np.float64]
    columns: Mapping[str, NDArray[np.float64]]
    flags: NDArray[np.uint8]
    lost: int


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

    def safe(self) -> None:
        """Disarm: command 0, load 0, confirmed by the logger.

        Raises:
            DriverError: The logger did not confirm; cut the power by hand.
        """
        self._logger.disarm()

    def rest(self, duration_s: float) -> Iterator[Reading]:
        """Read the disarmed rig for a while."""
        self.safe()
        remaining = round(duration_s * frames.SAMPLE_RATE_HZ)
        while remaining > 0:
            reading = self._read()
            remaining -= len(reading.time_s)
            yield reading

    def watch(self) -> Iterator[Reading]:
        """Read the rig as it is, without arming or moving it, until the caller stops."""
        while True:
            yield self._read()

    def play(
        self, target_angle_rad: NDArray[np.float64], load_command_a: NDArray[np.float64]
    ) -> Iterator[Reading]:
        """Arm the rig and play a trajectory; readings begin with the first setpoint played.

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
        lead = round(LEAD_S * frames.SAMPLE_RATE_HZ)
        self._logger.arm(self.config.controller.gains(), self._board_limits())
        queued = played = 0
        while played < targets.size:
            while queued < min(played + lead, targets.size):
                block = slice(queued, min(queued + BLOCK, targets.size))
                self._logger.queue(targets[block], loads_ma[block])
                queued = block.stop
            reading = self._read()
            self._check_board(reading)
            playing = (reading.counts["status"] & frames.STATUS_QUEUE_DRY) == 0
            if played == 0:
                reading = _from(reading, int(np.argmax(playing)) if playing.any() else len(playing))
                playing = playing[len(playing) - len(reading.time_s) :]
            left = targets.size - played
            ends = np.searchsorted(np.cumsum(playing), left)
            reading = _until(reading, int(ends) + 1)
            played += int(np.sum(playing[: len(reading.time_s)]))
            if len(reading.time_s):
                yield reading

    def _read(self) -> Reading:
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
        reading = self._convert(batch)
        self._check_limits(reading)
        return reading

    def _convert(self, batch: SampleBatch) -> Reading:
        if self._first_tick_us is None:
            self._first_tick_us = int(batch.tick_us[0])
        status = batch.samples["status"]
        flags = np.zeros(len(status), np.uint8)
        flags[(status & frames.STATUS_SATURATED) != 0] |= Flag.SATURATED
        tripped = frames.STATUS_WATCHDOG_TRIPPED | frames.STATUS_LIMIT_TRIPPED
        flags[(status & tripped) != 0] |= Flag.SUSPECT
        armed = (status & frames.STATUS_ARMED) != 0
        flags[armed & ((status & frames.STATUS_QUEUE_DRY) != 0)] |= Flag.STALE
        return Reading(
            batch.samples,
            batch.tick_us,
            (batch.tick_us - self._first_tick_us) * 1e-6,
            self.calibrations.apply(batch.samples, self.zeros),
            flags,
            batch.lost,
        )

    def _to_counts(self, channel: str, values: NDArray[np.float64]) -> NDArray[np.int32]:
        line = self.calibrations.channels[channel]
        return np.round(values / line.slope + line.zero_counts).astype(np.int32)

    def _board_limits(self) -> dict[str, int]:
        """Return the limits the board checks itself, in its own counts."""
        lines, limits = self.calibrations.channels, self.config.limits
        return {
            lines[name].counts: int(abs(getattr(limits, name) / lines[name].slope))
            for name in ("proximal_torque_n_m", "distal_torque_n_m", "motor_current_a")
        }

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
            (frames.STATUS_LIMIT_TRIPPED, "The logger tripped one of its own limits.", ""),
            (
                frames.STATUS_WATCHDOG_TRIPPED,
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


def _until(reading: Reading, stop: int) -> Reading:
    return _cut(reading, slice(None, stop))


def _from(reading: Reading, start: int) -> Reading:
    return _cut(reading, slice(start, None))


def _cut(reading: Reading, part: slice) -> Reading:
    return Reading(
        reading.counts[part],
        reading.tick_us[part],
        reading.time_s[part],
        {name: values[part] for name, values in reading.columns.items()},
        reading.flags[part],
        reading.lost,
    )


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
