"""Faults of every kind in random order: is each detected and named, and how fast is the rig safe.

The board is the firmware's core; its inputs are a script, so that every sample says by its counts
at which tick it was taken. Everything is in virtual time.
"""

import random
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.reliability import encoder_faults
from benchmarks.reliability.encoder_faults import (
    CURRENT,
    DISTAL,
    JAW,
    MOTOR,
    PROXIMAL,
    SPINDLE,
)
from benchmarks.reliability.fault_names import EVIDENCE, SAID
from drivers.errors import DriverError
from drivers.registry import fakes
from drivers.teensy.core import TICK, FirmwareBoard
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.protocol import MISSING, STATUS_ARMED, Trip
from drivers.transport.faulty import Fault, Faults, FaultyTransport
from drivers.transport.simulated import SimulatedTransport
from rig.bench.session import Session
from rig.configuration.config import Config, load_config
from rig.errors import RigError

STEP_S = 0.005
MOTOR_STEP = 3
HOLD = np.full(1500, -1.0)
NO_LOAD = np.zeros(1500)

SAFETY = {
    "watchdog_s": 0.05,
    "stall_s": 0.1,
    "stale_s": 0.1,
    "saturated_s": 0.02,
    "heat_a2_s": 0.02,
    "continuous_current_a": 0.3,
    "jaw_open_rad": -1.0,
    "jaw_closed_rad": 1.0,
}
"""Times short enough to wait for, a thousand times over."""

ONE_BY_ONE = {"gear_ratio": 0, "jaw_ratio": 0}
"""The script turns its motor and nothing else, so its encoders are not compared."""
ASIDE: dict[str, dict[str, dict[str, float]]] = {
    "stalled": {
        "safety": {"heat_a2_s": 0.5},
        "plausibility": {
            "current_window_a": 1000.0,
            "frozen_current_a": 1000.0,
            "still_torque_n_m": 1000.0,
            "still_rise_n_m": 1000.0,
        },
    },
    "overheated": {"plausibility": {"current_window_a": 1000.0}},
    "sensor saturated": {"limits": {"proximal_torque_n_m": 2.0}},
}
"""Where another watch would rightly be faster: it is widened, so that the one meant is tried."""

SENSOR_FAULTS: dict[str, tuple[Trip, int, int | None, float]] = {
    "over-current": (Trip.OVER_CURRENT, CURRENT, 700, 0.0),
    "torque at the spindle": (Trip.PROXIMAL_TORQUE, PROXIMAL, 16000, 0.0),
    "torque at the jaw": (Trip.DISTAL_TORQUE, DISTAL, -11000, 0.0),
    "spindle travel": (Trip.SPINDLE_TRAVEL, SPINDLE, 5000, 0.0),
    "jaw travel": (Trip.JAW_TRAVEL, JAW, 800, 0.0),
    "over-speed": (Trip.OVER_SPEED, MOTOR, 700, 0.002),
    "overheated": (Trip.OVERHEATED, CURRENT, 540, 0.0993),
    "stalled": (Trip.STALLED, MOTOR, None, 0.1),
    "sensor saturated": (Trip.SENSOR_SATURATED, PROXIMAL, None, 0.02),
    "sensor stale": (Trip.SENSOR_STALE, DISTAL, 17, 0.1),
    "sensor missing": (Trip.SENSOR_MISSING, SPINDLE, MISSING, 0.0),
}
"""Trip expected, input struck, its count (or how it moves, see `ScriptedRig`), time allowed, s."""


@dataclass(frozen=True)
class Outcome:
    """Result of one fault.

    Attributes:
        detected: Whether the program noticed.
        named: Whether it said what it was: the trip's own code, an error, or counters that rise
            with this fault of the link alone. Where a protocol does not distinguish two faults,
            neither is named.
        mis_stamped: Samples whose counts are of another tick than their time stamp says.
        safe_after_s: Virtual time from the fault, less the time it is allowed to last, to the safe
            state; None where the rig rightly goes on.
        crash: An error that is none of the project's own; empty for none.
    """

    kind: str
    detected: bool
    named: bool
    mis_stamped: int
    safe_after_s: float | None = None
    crash: str = ""


class ScriptedRig:
    """Implements `drivers.teensy.core.FirmwareBench`: the motor counts ticks, sensors make noise.

    Args:
        kind: The sensor fault that strikes; none if not one of `SENSOR_FAULTS`.
        after_ticks: How long after arming.
    """

    def __init__(self, kind: str, after_ticks: int) -> None:
        self._fault = SENSOR_FAULTS.get(kind)
        self._kind = kind
        self._after_ticks = after_ticks
        self._tick = 0
        self.board: FirmwareBoard | None = None
        self.struck_at: int | None = None
        """Tick at which the fault struck."""

    def advance_with_board(
        self, ticks: int, tick_address: int, board_address: int, tick_us: int
    ) -> None:
        """Run the script; see `drivers.teensy.core.FirmwareBench.advance_with_board`."""
        tick = TICK(tick_address)
        outputs = np.zeros(2, np.int32)
        for k in range(ticks):
            armed = self.board is not None and self.board.in_force
            if self.struck_at is None and self._fault and armed:
                self.struck_at = self._tick + self._after_ticks
            row = self._inputs()
            self._tick += 1
            clock_us = (tick_us + 1000 * k) % 2**32
            tick(board_address, clock_us, row.ctypes.data, outputs.ctypes.data)

    def _inputs(self) -> NDArray[np.int32]:
        row = np.zeros(7, np.int32)
        row[MOTOR] = MOTOR_STEP * self._tick
        row[SPINDLE] = 1304
        for column in (PROXIMAL, DISTAL, CURRENT):
            row[column] = self._tick * (7 + column) % 23 - 11
        if self._fault is None or self.struck_at is None or self._tick < self.struck_at:
            return row
        _, column, value, _ = self._fault
        since = self._tick - self.struck_at
        if self._kind == "stalled":
            row[MOTOR] = MOTOR_STEP * self.struck_at
            row[CURRENT] = 560 + since % 5
        elif self._kind == "over-speed":
            row[MOTOR] += 700 * (since + 1)
        else:
            row[column] = 32767 if value is None else value
        return row


def inject(count: int, seed: int = 0) -> Iterator[Outcome]:
    """Yield the outcome of each of `count` faults, every kind, in random order."""
    generator = random.Random(seed)
    kinds = [*SENSOR_FAULTS, *encoder_faults.FAULTS, "host killed", "cable cut", *_LINK_FAULTS]
    order = [kinds[k % len(kinds)] for k in range(count)]
    generator.shuffle(order)
    config = load_config().changed(
        safety=SAFETY,
        limits={"proximal_torque_n_m": 0.6, "distal_torque_n_m": 0.4},
        plausibility=ONE_BY_ONE,
    )
    for kind in order:
        try:
            if kind in _LINK_FAULTS:
                yield _link_fault(kind, generator.randrange(2**32))
            elif kind in encoder_faults.FAULTS:
                fault, codes = encoder_faults.FAULTS[kind]
                trip = encoder_faults.ride(fault)[2]
                yield Outcome(kind, trip is not Trip.NONE, trip in codes, 0)
            else:
                yield _safety_fault(kind, generator.randrange(1, 200), config)
        except Exception as error:
            yield Outcome(kind, False, False, 0, None, f"{type(error).__name__}: {error}")


_DEVICES = tuple(fakes())
_LINK_FAULTS = tuple(f"{fault.value} on the link of {d}" for d in _DEVICES for fault in Fault)


def _link_fault(kind: str, seed: int) -> Outcome:
    """Let a fault strike a device's link: counted, or said, and nothing made up."""
    word, name = kind.split(" on the link of ")
    fault = Fault(word)
    faults = Faults(seed=seed)
    device = fakes()[name](faults)
    device.start()
    rate_hz = device.channels[0].rate_hz
    for _ in range(30):
        device.read(max(0.1, 2 / rate_hz))
    earlier = dict(device.counters)
    before = sum(count for counter, count in earlier.items() if counter != "frames")
    faults.inject(fault, 4, duration_s=max(0.3, 10 / rate_hz))
    said = False
    numbers: list[int] = []
    mis_stamped = 0
    for _ in range(40):
        try:
            batch = device.read(max(0.1, 2 / rate_hz))
        except DriverError as error:
            said = bool(error.what)
            continue
        mis_stamped += int(np.count_nonzero(np.diff(batch.sequence) <= 0))
        mis_stamped += int(np.count_nonzero(np.diff(batch.time_s) < 0))
        if len(batch) and numbers and batch.sequence[0] <= numbers[-1]:
            mis_stamped += 1
        numbers += batch.sequence[-1:].tolist()
    after = sum(count for counter, count in device.counters.items() if counter != "frames")
    risen = {name for name, count in device.counters.items() if count > earlier.get(name, 0)}
    named = said if fault is Fault.DISCONNECT else _is_named(name, fault, risen - EVIDENCE)
    device.close()
    return Outcome(kind, after > before or said, named, mis_stamped)


def _is_named(device: str, fault: Fault, risen: set[str]) -> bool:
    """Whether counters belong to this fault, and to no other fault of the device."""
    names = SAID[device]
    return bool(risen) and risen <= names[fault] and list(names.values()).count(names[fault]) == 1


def _safety_fault(kind: str, after_ticks: int, config: Config) -> Outcome:
    """Let a fault strike an armed rig: it must trip with its own code and be safe in time."""
    config = config.changed(**ASIDE.get(kind, {}))
    bench = ScriptedRig(kind, after_ticks)
    board = bench.board = FirmwareBoard(bench)
    faults = Faults()
    link = FaultyTransport(SimulatedTransport(board, step_s=STEP_S), faults)
    ticks: list[NDArray[np.int64]] = []
    motors: list[NDArray[np.int64]] = []
    said = ""
    ways_out = ExitStack()
    try:
        with ways_out:
            session = ways_out.enter_context(Session(config, link))
            for _ in session.rest(0.05):
                pass
            for reading in session.play(HOLD, NO_LOAD):
                struck = bench.struck_at
                before = np.inf if struck is None else 1000 * struck
                of_script = reading.tick_us < before
                ticks.append(reading.tick_us[of_script])
                motors.append(reading.counts["motor"][of_script].astype(np.int64))
                if reading.setpoint.max() < after_ticks:
                    continue
                if kind == "cable cut":
                    faults.inject(Fault.DISCONNECT)
                elif kind == "host killed":
                    ways_out.pop_all()  # a killed process runs none of its ways out
                    break
    except (RigError, DriverError) as error:
        said = str(error) + str(error.__context__ or "")
    if kind in ("host killed", "cable cut"):
        return _after_silence(kind, board, said, _mis_stamped(ticks, motors))
    trip, _, _, allowed_s = SENSOR_FAULTS[kind]
    report = TeensyLogger(SimulatedTransport(board)).trip()
    assert bench.struck_at is not None
    safe_after_s = report.tick_us * 1e-6 - bench.struck_at * 1e-3 - allowed_s
    named = report.code is trip and f"code {int(trip)}" in said
    return Outcome(kind, bool(said), named, _mis_stamped(ticks, motors), safe_after_s)


def _after_silence(
    kind: str,
    board: FirmwareBoard,
    said: str,
    mis_stamped: int,
) -> Outcome:
    board.advance(200)
    board.transmit()
    logger = TeensyLogger(SimulatedTransport(board))
    report = logger.trip()
    logger.identify()
    logger.start()
    armed = bool(logger.read(0.1).samples["status"][-1] & STATUS_ARMED)
    told = kind == "host killed" or "did not confirm" in said
    named = report.code is Trip.HOST_SILENT and told
    safe = None if armed else report.late_us * 1e-6
    return Outcome(kind, not armed, named, mis_stamped, safe)


def _mis_stamped(ticks: list[NDArray[np.int64]], motors: list[NDArray[np.int64]]) -> int:
    """Return how many samples were taken at another tick than their stamp says."""
    if not ticks:
        return 0
    expected = MOTOR_STEP * (np.concatenate(ticks) // 1000)
    return int(np.count_nonzero(np.concatenate(motors) != expected))
