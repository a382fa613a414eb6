"""From a wired bench to its first motion: every sensor must answer a small current the right way.

The position loop is kept out: its gain makes the command a constant pulse, whose size is its limit.
The pulses grow until the shaft turns and end with it; each is ended by the board itself, whose
queue runs dry. A shaft that turns, or an encoder that counts, the wrong way is then a sentence and
not a run-away.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from drivers.errors import CommandRefusedError
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.protocol import STATUS_ARMED, TOP, Trip
from drivers.teensy.reference import Limits
from rig.bench.logger import held_logger, read_for
from rig.bench.trips import WORDS
from rig.configuration.config import Config
from rig.doctor.selftest import Check
from rig.errors import UsageError
from rig.machines.choose import machine_of

STEPS_RATIO = (0.005, 0.01, 0.02, 0.04, 0.06, 0.08, 0.10, 0.13, 0.16, 0.20)
"""Pulses, of a full command; none is larger than the configured controller's limit."""
PULSE_S = 0.05
REST_S, LOOK_S = 10.0, 0.1
"""A shaft that coasts on from the pulse before is waited for so long, s, in such steps."""
REACH_RAD = 0.12
"""How far the spindle may turn from where it stands; beyond it the board releases."""
TURNED_RAD = 0.01
"""What counts as a turn of the spindle."""
SEEN_RAD = 0.003
"""What an encoder must count when the spindle has turned."""
CURRENT_SHARE = 0.5
"""Least share of the commanded current that the read-back must show."""
OPEN_LOOP_SHARE = 0.3
"""Share of the reach at which the position loop would begin to lower the pulse."""
ENCODERS = ("motor_angle_rad", "spindle_angle_rad", "jaw_angle_rad")


@dataclass(frozen=True, eq=False)
class Pulse:
    """What a pulse did."""

    ratio: float  # its size, of a full command in SI signs, closing positive
    change: dict[str, float]  # change of each encoder, rad at the spindle, by channel
    # mean measured current at its end less that before, A; None without a read-back
    current_a: float | None
    trip: Trip  # what the board tripped over; `Trip.NONE` for nothing


def commission(config: Config) -> Iterator[Check]:
    """Yield the checks of a first motion as they are made; the first that fails is the last.

    The rig has one motor, which is powered, and no object in its jaw; it is referenced.

    Raises:
        UsageError: A rig with several motors.
        DriverError: The board cannot be reached, or refuses.
    """
    machine = machine_of(config)
    limits = machine.board_limits(config, config.calibration_set())
    if not isinstance(limits, Limits):
        raise UsageError(
            f"{config.name} has {machine.profile.motors} motors.",
            "The first motion is for rigs with one.",
            "Wire one motor after another to a rig of the reference profile first.",
        )
    with held_logger(config) as logger:
        identity = logger.identify()
        yield Check("the board answers", True, f"{identity.serial}, start {identity.boot}")
        ready = _is_ready(logger)
        yield ready
        if not ready.passed:
            return
        logger.start()
        bench = _Bench(config, logger, limits)
        for closing in (1, -1):
            for check in _first_turn(bench, closing):
                yield check
                if not check.passed:
                    return
        logger.stop()


def _is_ready(logger: TeensyLogger) -> Check:
    trip = logger.trip().code
    name = "nothing is tripped and the encoders have their zeros"
    if trip is not Trip.NONE:
        return Check(name, False, f"{WORDS[trip][0]}. {WORDS[trip][1]} Then run: rig clear")
    referenced = logger.identify().referenced
    return Check(name, referenced, "" if referenced else "Run: rig reference")


def _first_turn(bench: "_Bench", closing: int) -> Iterator[Check]:
    """Grow the pulse until the spindle turns, and judge what every sensor has shown."""
    word = "closing" if closing > 0 else "opening"
    pulse = Pulse(0.0, {}, None, Trip.NONE)
    for ratio in STEPS_RATIO:
        if ratio * 1e4 > bench.config.controller.limit:
            break
        pulse = bench.pulse(closing * ratio)
        if pulse.trip is not Trip.NONE:
            yield Check(f"a pulse of {100 * ratio:g}%, {word}", False, WORDS[pulse.trip][0])
            return
        if max(map(abs, pulse.change.values())) >= TURNED_RAD:
            break
    current = _judge_current(bench, pulse, word)
    if current is not None:
        yield current
    turned = max(map(abs, pulse.change.values()), default=0.0) >= TURNED_RAD
    percent = f"{abs(100 * pulse.ratio):g}%"
    blocked = f"not up to {percent}: supply, enable, set value or a blocked shaft"
    detail = f"at {percent} of a full command" if turned else blocked
    yield Check(f"the shaft turns, {word}", turned, detail)
    for name, change in pulse.change.items() if turned else ():
        seen = change * closing
        fault = "counts nothing" if abs(change) < SEEN_RAD else "counts the wrong way: swap A and B"
        said = f"{change:+.3f} rad at the spindle"
        good = seen >= SEEN_RAD
        yield Check(f"{name} follows, {word}", good, said if good else f"{said}; it {fault}")


def _judge_current(bench: "_Bench", pulse: Pulse, word: str) -> Check | None:
    if pulse.current_a is None or not pulse.ratio:
        return None
    asked_a = pulse.ratio * bench.config.plausibility.command_full_scale_a
    good = pulse.current_a / asked_a >= CURRENT_SHARE
    look = "" if good else "; look at enable, the direction line and the read-back"
    detail = f"{pulse.current_a:+.3f} A of {asked_a:+.3f} A{look}"
    return Check(f"the measured current follows the command, {word}", good, detail)


class _Bench:
    """Gives pulses within limits that are narrow about where the rig stands."""

    def __init__(self, config: Config, logger: TeensyLogger, limits: Limits) -> None:
        self.config = config
        self._logger = logger
        self._limits = limits
        self._lines: CalibrationSet = config.calibration_set()
        self._rate_hz = machine_of(config).profile.rate_hz

    def pulse(self, ratio: float) -> Pulse:
        """Give one pulse, disarm, and return what it did."""
        lines = self._lines.channels
        before = self._at_rest()
        here = int(np.median(before["spindle"]))
        reach = abs(REACH_RAD / lines["spindle_angle_rad"].slope)
        command = ratio / lines["motor_command_ratio"].slope
        target = here + round(np.sign(command) * 0.9 * reach)
        gain = abs(command) / (OPEN_LOOP_SHARE * reach)
        self._logger.arm([gain, 0.0, 0.0, 1.0, abs(command)], self._narrow(here, round(reach)))
        try:
            count = round(PULSE_S * self._rate_hz)
            self._logger.queue(np.full(count, target), np.zeros(count, np.int64))
        except CommandRefusedError:
            if self._logger.trip().code is Trip.NONE:
                raise
        during = self._read(2 * PULSE_S)
        self._logger.disarm()
        trip = self._logger.trip().code
        if trip is not Trip.NONE:
            self._logger.clear(int(trip))  # it was made here; any but the pulse's end is reported
        if trip is Trip.QUEUE_RAN_DRY:
            trip = Trip.NONE
        armed = during[(during["status"] & STATUS_ARMED) != 0]
        return Pulse(ratio, self._changes(before, armed), self._current_a(before, armed), trip)

    def _at_rest(self) -> NDArray[np.void]:
        """Return samples of the standing shaft, or the newest when it does not come to rest."""
        still = max(1.0, 0.1 * SEEN_RAD / abs(self._lines.channels["spindle_angle_rad"].slope))
        for _ in range(round(REST_S / LOOK_S)):
            samples = self._read(LOOK_S)
            if np.ptp(samples["spindle"]) <= still:
                break
        return samples

    def _narrow(self, here: int, reach: int) -> Limits:
        """Return the limits about where it stands; what is being tested is not yet believed."""
        return replace(
            self._limits,
            min_spindle=max(self._limits.min_spindle, here - reach),
            max_spindle=min(self._limits.max_spindle, here + reach),
            max_load_ma=0,
            max_motor_step=max(1, self._limits.max_motor_step // 4),
            dry_ticks=1,
            motor_per_turn=0,
            jaw_per_turn=0,
            full_scale_current=0,
            torque_e3=0,
            frozen_current=TOP,
            stale_ticks=TOP,
            hold_ticks=1,
            safe_state=0,
        )

    def _changes(self, before: NDArray[np.void], armed: NDArray[np.void]) -> dict[str, float]:
        believed = self.config.plausibility
        per_spindle = {"motor_angle_rad": believed.gear_ratio, "jaw_angle_rad": believed.jaw_ratio}
        changes = {}
        for name in ENCODERS:
            line = self._lines.channels.get(name)
            ratio = per_spindle.get(name, 1.0)
            if line is None or not ratio or not len(armed):
                continue
            count = line.counts
            far = armed[count].astype(float) - np.median(before[count])
            changes[name] = float(far[np.argmax(np.abs(far))]) * line.slope / ratio
        return changes

    def _current_a(self, before: NDArray[np.void], armed: NDArray[np.void]) -> float | None:
        line = self._lines.channels.get("motor_current_a")
        if line is None or len(armed) < 4:
            return None
        driven = armed[armed["command_e4"] != 0][line.counts]
        late = driven[len(driven) // 2 :]
        return float((np.mean(late) - np.mean(before[line.counts])) * line.slope)

    def _read(self, duration_s: float) -> NDArray[np.void]:
        return read_for(self._logger, duration_s, is_alive=True).samples
