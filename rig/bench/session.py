"""A session with the rig: connected devices, limits checked at every sample, safe on every way out.

The session streams from start to end. `rest` reads the disarmed rig; `play` arms it and plays a
trajectory. Whatever ends the session (the end, an error, Ctrl-C, SIGTERM, a lost terminal), the
logger is disarmed first, and the disarming is confirmed by the logger itself.
"""

import gc
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from calibration.zero import MINIMUM_SAMPLES, measure_zeros
from drivers.errors import CommandRefusedError, DriverError
from drivers.teensy.profile import ArmLimits
from drivers.teensy.protocol import Identity, Result, Trip, TripReport
from drivers.transport.transport import Transport
from rig.bench.companions import Beside, Companion, open_companions, refuse_shared_names
from rig.bench.device_logger import logger_on, raw_stream, with_channels
from rig.bench.flight import FlightRecorder
from rig.bench.holding import holding
from rig.bench.intake import Intake
from rig.bench.interrupts import leaving_safely
from rig.bench.limited import refuse_unknown_limits
from rig.bench.logger import is_real_time
from rig.bench.sensor_logger import SensorWay
from rig.bench.trips import HostWatch, require_same_start, trip_error, tripped
from rig.configuration.config import Config
from rig.errors import SafetyTripError, UsageError
from rig.log.devices import topic_of
from rig.log.schema import Stream
from rig.logic.link import LogicLink
from rig.machines.choose import machine_of
from rig.machines.reading import Reading, reading_of, with_setpoints
from rig.machines.safety import check_samples

LEAD_S = 0.3
"""Setpoints are kept this far ahead of the rig, s: longer than any pause of the host."""

UNENDING = 2**62
"""Number of setpoints while it is not known how many there will be."""

COOLING_STEP_S, COOLING_S = 0.25, 60.0
"""How long a board whose motors are too warm to be armed is waited for, s, and in which steps."""


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
        self.raw: Stream
        """Stream of the samples as they came, in a log."""
        self.machine = machine_of(config)
        self.flight: FlightRecorder | None = None
        """What was sent to the board, where there is one."""
        self.newest_tick_us = 0
        self.newest: Reading | None = None
        """The newest reading, also the one in which a limit was crossed."""
        if not isinstance(transport, LogicLink | SensorWay):
            transport = self.flight = FlightRecorder(transport, self._tick_us)
        self._logger = logger_on(transport, self.machine.profile)
        self._transport = transport
        self._ways_out = ExitStack()
        self._first_tick_us: int | None = None
        self.here: tuple[float, ...] = ()
        """Where it stood in the newest sample: what its setpoints ask for, rad."""
        self._watch: HostWatch | None = None
        self._is_real_time = is_real_time(config)
        self._intake = Intake(self._logger, transport, self._is_real_time)
        self.clock = self._intake.clock
        self.companions: list[Companion] = []

    def __enter__(self) -> Self:
        with ExitStack() as ways_out:
            ways_out.enter_context(leaving_safely())  # left last: no signal breaks the way out
            ways_out.enter_context(holding(self.config.logger.url))
            ways_out.callback(self._close)
            self.identity = self._logger.identify()
            self._take_channels()
            self.companions = open_companions(self.config)
            for companion in self.companions:
                ways_out.callback(companion.device.close)
            ways_out.callback(self._stop_streaming)
            for companion in self.companions:
                companion.begin(self._transport.now_s)
            refuse_shared_names(self.companions, self.calibrations.channels)
            refuse_unknown_limits(self.config, self.calibrations, self.companions)
            self._logger.start()
            self._ways_out = ways_out.pop_all()
        return self

    def __exit__(self, *raised: Any) -> None:
        self._ways_out.__exit__(*raised)

    def _take_channels(self) -> None:
        """Add what a device measures besides a logger's counts."""
        channels = getattr(self._logger, "channels", ())
        self.raw = self.machine.counts
        if not channels:
            return
        has_logger = bool(self.machine.setpoint_channels)
        self.calibrations = with_channels(self.calibrations, channels, has_logger)
        self.raw = raw_stream(channels, self.machine.counts, has_logger)
        self.machine = self.machine.at(channels[0].rate_hz)

    @property
    def counters(self) -> Mapping[str, int]:
        """The link's counters: frames, CRC errors, gaps, lost samples, discarded bytes, retries."""
        return self._logger.counters.as_dict()

    def take_beside(self) -> dict[str, Beside]:
        """Return the samples of each further device since the last call, by its topic in a log."""
        return {topic_of(companion.name): companion.take() for companion in self.companions}

    @property
    def board(self) -> dict[str, str]:
        """Who the board is, as a log and a calibration keep it."""
        return {
            "logger_serial": self.identity.serial,
            "firmware_version": self.identity.firmware_version,
            "firmware_build": f"{self.identity.build_hash:08x}",
            "board_start": str(self.identity.boot),
        }

    def safe(self) -> None:
        """Disarm: command 0, load 0, confirmed by the logger.

        Raises:
            DriverError: The logger did not confirm; cut the power by hand.
        """
        self._watch = None
        self._logger.disarm()

    def rest(self, duration_s: float) -> Iterator[Reading]:
        """Read the disarmed rig for a while."""
        self.safe()
        remaining = round(duration_s * self.machine.profile.rate_hz)
        while remaining > 0:
            reading = self._read()
            remaining -= len(reading.time_s)
            yield reading

    def take_zeros(self, duration_s: float) -> dict[str, float]:
        """Measure the zeros of the disarmed rig and use them from now on.

        A slow device is read for longer, until it has given readings enough.

        Raises:
            CalibrationError: Too few samples came.
        """
        if any(line.tared for line in self.calibrations.channels.values()):
            duration_s = max(duration_s, MINIMUM_SAMPLES / self.machine.profile.rate_hz)
        counts = np.concatenate([reading.counts for reading in self.rest(duration_s)])
        self.zeros = measure_zeros(counts, self.calibrations)
        return self.zeros

    def watch(self) -> Iterator[Reading]:
        """Read the rig as it is, without arming or moving it, until the caller stops."""
        while True:
            yield self._read()

    def play(self, *setpoints: NDArray[np.float64]) -> Iterator[Reading]:
        """Arm the rig and play a trajectory; each sample has the number of its setpoint.

        Args:
            setpoints: What is asked for at the board's rate, closing-positive, each of shape (n,):
                the spindle's angle, rad, and the load motor's current, A; of a grasper the angles
                of yaw, jaw 1 and jaw 2, rad.

        Raises:
            UsageError: The motion is for another kind of rig.
            SafetyTripError: A limit was crossed; the rig is disarmed.
            LoggerStalledError: The logger fell silent; the rig's own watchdog makes it safe.
        """
        if not self.machine.setpoint_channels:
            yield from self._observe(setpoints[0].size)
            return
        if len(setpoints) != len(self.machine.setpoint_channels):
            raise UsageError(
                f"{self.config.name} takes {', '.join(self.machine.setpoint_channels)}.",
                f"The motion has {len(setpoints)} of them: it is for another kind of rig.",
                "Choose a configuration with another [logger] profile.",
            )
        self.machine.check_setpoints(self.config, setpoints)
        most = self.machine.profile.max_setpoints
        blocks = [slice(cut, cut + most) for cut in range(0, setpoints[0].size, most)]
        yield from self.follow(tuple(column[b] for column in setpoints) for b in blocks)

    def _observe(self, samples: int) -> Iterator[Reading]:
        """Read so many samples of a device without motors; their setpoints are their numbers."""
        first: int | None = None
        while samples > 0:
            reading = self._read()
            number = reading.counts["sequence"].astype(np.int64)
            first = int(number[0]) if first is None else first
            setpoint = np.where(number < first + samples, number - first, -1)
            yield replace(reading, setpoint=setpoint)
            if number[-1] >= first + samples - 1:
                return

    def follow(
        self, setpoints: Iterator[tuple[NDArray[np.float64], ...]], lead_s: float = LEAD_S
    ) -> Iterator[Reading]:
        """Arm the rig and play setpoints that are computed during the run, until there are no more.

        A piece is requested `lead_s` before it is played, so a reading can change setpoints from
        then on.

        Args:
            setpoints: Pieces of what `play` takes, each of shape (n,), n from 1 to the profile's
                `max_setpoints`.
            lead_s: Time between asking and playing; shorter pauses of this computer do no harm.

        Raises:
            SafetyTripError: A setpoint or a sample is beyond a limit; the rig is disarmed.
            LoggerStalledError: The logger fell silent; the rig's own watchdog makes it safe.
        """
        lead = round(lead_s * self.machine.profile.rate_hz)
        board = self.machine.board_limits(self.config, self.calibrations)
        if self._watch is not None:
            self.safe()  # the motion before this one is over
        gains = self.machine.gains(self.config)
        if self._is_real_time:
            gc.collect()
            gc.freeze()  # collecting all that was imported takes longer than a board waits
        self._arm(gains, board)
        self._watch = HostWatch(gains, board, self.machine)
        queued = played = 0
        is_over = False
        newest_sequence: int | None = None
        while not is_over or played < queued:
            while not is_over and queued < played + lead:
                piece = next(setpoints, None)
                if piece is None:
                    is_over = True
                    break
                self.machine.check_setpoints(self.config, piece)
                names = self.machine.setpoint_channels
                self._queue(*(self._to_counts(n, v) for n, v in zip(names, piece, strict=True)))
                queued += piece[0].size
            reading = self._read()
            # until the end is known, a queue that ran dry is a setpoint that is missing
            planned = queued if is_over else UNENDING
            reading = with_setpoints(reading, played, planned, newest_sequence)
            played = max(played, int(reading.setpoint.max()) + 1)
            newest_sequence = int(reading.counts["sequence"][-1]) if played else None
            yield reading

    def _arm(self, gains: Sequence[Any], limits: ArmLimits) -> None:
        """Arm the board; one whose motors are warm is waited for."""
        give_up_s = self._transport.now_s + COOLING_S
        while True:
            try:
                return self._logger.arm(gains, limits)
            except CommandRefusedError as error:
                report = self._logger.trip()
                if error.code == Result.TRIPPED and report.code is not Trip.NONE:
                    state = "It tripped before this run and has not been cleared; nothing moved."
                    raise self._tripped(report, state) from error
                if error.code != Result.TOO_HOT or self._transport.now_s > give_up_s:
                    raise
            for _ in self.rest(COOLING_STEP_S):
                pass

    def settle(self) -> None:
        """Move the unloaded rig a little, so that friction gives up the torque it holds."""
        for _ in self.play(*self.machine.settling(self.here).setpoints):
            pass

    def _tick_us(self) -> int:
        """Return the board's clock now; exact where time is virtual."""
        virtual = self.config.is_simulated and not self._is_real_time
        return round(self._transport.now_s * 1e6) if virtual else self.newest_tick_us

    def _read(self) -> Reading:
        batch = self._intake.next(self.identity.boot)
        if self._first_tick_us is None:
            self._first_tick_us = int(batch.tick_us[0])
        reading = reading_of(batch, self.calibrations, self.zeros, self._first_tick_us)
        self.newest_tick_us = int(reading.tick_us[-1])
        self.here = self.machine.here(reading.columns)
        self.newest = reading
        try:
            trip = tripped(reading)
            if self._watch is not None and trip is not None:
                state = "It holds the spindle with a low command" if trip[1] else "It is released"
                raise self._tripped(self._logger.trip(), f"{state}, until it is cleared.")
            check_samples(self.config.limits.model_dump(), reading.columns, reading.time_s)
            for companion in self.companions:
                companion.poll(self._transport.now_s)
            crossing = self._watch.check(reading) if self._watch else None
            if crossing is not None:
                raise self._tripped(crossing, "This computer is disarming the rig.")
        except SafetyTripError:
            self.safe()
            raise
        return reading

    def _tripped(self, report: TripReport, state: str) -> SafetyTripError:
        return trip_error(report, self.calibrations, state, self.machine)

    def _queue(self, *columns: NDArray[np.int32]) -> None:
        """Queue setpoints; raise the trip of a board that has tripped since the last read."""
        try:
            self._logger.queue(*columns)
        except CommandRefusedError as error:
            report = self._logger.trip()
            if report.code is Trip.NONE:
                require_same_start(self._logger, self.identity.boot)
                raise
            state = "It is in its safe state, until it is cleared."
            raise self._tripped(report, state) from error

    def _to_counts(self, channel: str, values: NDArray[np.float64]) -> NDArray[np.int32]:
        line = self.calibrations.channels[channel]
        return np.round(values / line.slope + line.zero_counts).astype(np.int32)

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
            # a logger that did not confirm will not answer this either; the first error counts
            with suppress(DriverError):
                self._logger.stop()

    def _close(self) -> None:
        """Let go of the link; whether the rig was disarmed has been settled before."""
        gc.unfreeze()
        with suppress(DriverError):
            self._logger.close()
