"""The limit checks of an armed board on every sample, and the motor commands of a tick.

`check` and `drive` of `firmware/core/profile_reference.hpp` in Python: the same integer operations
in the same order, so that fake and firmware answer with the same bytes. Counts and ticks
throughout; `drivers.teensy.reference.Limits` documents the limits.
"""

from dataclasses import dataclass, field
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from drivers.teensy.control import LIMIT, control_tick, new_state
from drivers.teensy.logic import BoardLogic
from drivers.teensy.protocol import GAIN_NAMES, MISSING, STATUS_ARMED, STATUS_HOLDING, Trip
from drivers.teensy.reference import LIMIT_NAMES, REFERENCE, TICK_US, Limits
from drivers.teensy.watches import (
    BOARD_PLACES,
    ENGAGED,
    HOLD_COMMAND,
    LAST_COUNT,
    MAX_STALL,
    MOTOR_PLACES,
    NO_CHANNEL,
    NONE,
    PRIMED,
    SATURATED_TICKS,
    STALL_ANCHOR,
    STALL_TICKS,
    STATE,
    TICKS,
    judge_by_time,
    motor_crossing,
    note_trip,
    sensor_crossing,
    silence,
    untripped,
)
from drivers.teensy.watches import LAST_MOTOR as LAST_MOTOR_OF_WATCH

(
    MOTOR,
    SPINDLE,
    JAW,
    PROXIMAL,
    DISTAL,
    CURRENT,
    FSR,
    COMMAND_E4,
    LOAD_MA,
    TARGET,
    STATUS,
) = range(11)
"""Columns of a tick's row: seven inputs, what the motors got, the target and the board's state."""
COLUMNS = 11

HOLD_TARGET = BOARD_PLACES
MOTOR_WATCH = BOARD_PLACES + 1
SENSOR_WATCH = MOTOR_WATCH + MOTOR_PLACES
GUARD_PLACES = SENSOR_WATCH + 1 + 2 * 3
"""Places in the guard's state, int64, behind those of every profile."""
LAST_MOTOR = MOTOR_WATCH + LAST_MOTOR_OF_WATCH

_AT = {name: place for place, name in enumerate(LIMIT_NAMES)}
MAX_CURRENT, MAX_PROXIMAL, MAX_DISTAL = (
    _AT["max_current"],
    _AT["max_proximal"],
    _AT["max_distal"],
)
MIN_SPINDLE, MAX_SPINDLE = _AT["min_spindle"], _AT["max_spindle"]
MIN_JAW, MAX_JAW = _AT["min_jaw"], _AT["max_jaw"]
MOTOR_LIMITS, CHOICE = _AT["max_motor_step"], _AT["stall_ticks"]
_OVER_CURRENT = int(Trip.OVER_CURRENT)
_PROXIMAL_TORQUE = int(Trip.PROXIMAL_TORQUE)
_DISTAL_TORQUE = int(Trip.DISTAL_TORQUE)
_SPINDLE_TRAVEL = int(Trip.SPINDLE_TRAVEL)
_JAW_TRAVEL = int(Trip.JAW_TRAVEL)
_SENSOR_MISSING = int(Trip.SENSOR_MISSING)
INT16 = (-(2**15), 2**15 - 1)
FSR_MAX = 4095


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """All that a tick of the board needs and changes, besides its inputs.

    Attributes:
        guard: State of the guard, see the places above, int64; changed in place.
        limits: `Limits.as_array`, int64.
        control_state: State of the controller, shape (4,); changed in place.
        gains: Gains of the controller, shape (5,); holding lowers its limit.
    """

    guard: NDArray[np.int64] = field(default_factory=lambda: untripped(GUARD_PLACES))
    limits: NDArray[np.int64] = field(default_factory=lambda: Limits.widest().as_array())
    control_state: NDArray[np.float64] = field(default_factory=new_state)
    gains: NDArray[np.float64] = field(default_factory=lambda: np.zeros(len(GAIN_NAMES)))

    @classmethod
    def armed(cls, gains: Any, limits: Limits | None = None, engaged: bool = True) -> "Drive":
        """Return a drive that was just armed; `engaged` where a setpoint has come already."""
        bounds = (limits or Limits.widest()).as_array()
        drive = cls(limits=bounds, gains=np.array(gains, np.float64))
        drive.guard[STATE] = STATUS_ARMED
        drive.guard[ENGAGED] = engaged
        return drive

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """Return guard, limits, controller and gains, as `drive_tick` takes them."""
        return self.guard, self.limits, self.control_state, self.gains


@numba.njit(cache=True)
def drive_tick(
    row: NDArray[np.int32],
    target: int,
    load_ma: int,
    guard: NDArray[np.int64],
    limits: NDArray[np.int64],
    control_state: NDArray[np.float64],
    gains: NDArray[np.float64],
) -> None:
    """Do one tick behind the inputs in `row`: hold the limits, then command the motors.

    Args:
        row: One row of `COLUMNS` counts; the inputs are read, the rest is written.
        target: Target of the spindle, counts, followed when armed and engaged.
        load_ma: Current of the load motor, mA, likewise.
        guard: State of the guard.
        limits: Limits the board was armed with.
        control_state: State of the controller.
        gains: Gains of the controller.
    """
    crossing = silence(guard, limits)
    if crossing[0] != NONE:
        _trip(guard, limits, gains, row, crossing)
    if guard[STATE] & (STATUS_ARMED | STATUS_HOLDING):
        crossing = _check(guard, limits, row)
        if crossing[0] != NONE:
            _trip(guard, limits, gains, row, crossing)
    row[COMMAND_E4] = 0
    row[LOAD_MA] = 0
    row[TARGET] = row[SPINDLE]
    followed = target
    if guard[STATE] & STATUS_HOLDING:
        followed = guard[HOLD_TARGET]
    if guard[STATE] & STATUS_HOLDING or (guard[STATE] & STATUS_ARMED and guard[ENGAGED]):
        row[TARGET] = followed
        row[COMMAND_E4] = control_tick(control_state, gains, followed, row[SPINDLE], row[MOTOR])
        if guard[STATE] & STATUS_ARMED:
            row[LOAD_MA] = load_ma
    row[STATUS] = guard[STATE]
    guard[TICKS] += 1


@numba.njit(cache=True)
def _trip(guard, limits, gains, row, crossing):  # type: ignore[no-untyped-def]
    """Go to the safe state."""
    if note_trip(guard, limits, crossing):
        guard[HOLD_TARGET] = row[SPINDLE]
        gains[LIMIT] = min(gains[LIMIT], float(limits[HOLD_COMMAND]))
        guard[MOTOR_WATCH + STALL_TICKS] = 0
        guard[SENSOR_WATCH + SATURATED_TICKS] = 0
        for k in range(3):
            guard[SENSOR_WATCH + LAST_COUNT + 3 + k] = 0


@numba.njit(cache=True)
def _check(guard, limits, row):  # type: ignore[no-untyped-def]
    """Return code, channel, value, limit and lateness of what is crossed, code 0 for nothing."""
    for channel in range(6):
        if row[channel] == MISSING:
            return _SENSOR_MISSING, channel, MISSING, 0, 0
    motor, current = np.int64(row[MOTOR]), np.int64(row[CURRENT])
    if not guard[PRIMED]:
        guard[PRIMED] = 1
        guard[LAST_MOTOR] = motor
        guard[MOTOR_WATCH + STALL_ANCHOR] = motor
        for k in range(3):
            guard[SENSOR_WATCH + LAST_COUNT + k] = row[PROXIMAL + k]
    if abs(current) > limits[MAX_CURRENT]:
        return _OVER_CURRENT, CURRENT, current, limits[MAX_CURRENT], 0
    proximal, distal = np.int64(row[PROXIMAL]), np.int64(row[DISTAL])
    if abs(proximal) > limits[MAX_PROXIMAL]:
        return _PROXIMAL_TORQUE, PROXIMAL, proximal, limits[MAX_PROXIMAL], 0
    if abs(distal) > limits[MAX_DISTAL]:
        return _DISTAL_TORQUE, DISTAL, distal, limits[MAX_DISTAL], 0
    spindle, jaw = np.int64(row[SPINDLE]), np.int64(row[JAW])
    if spindle < limits[MIN_SPINDLE]:
        return _SPINDLE_TRAVEL, SPINDLE, spindle, limits[MIN_SPINDLE], 0
    if spindle > limits[MAX_SPINDLE]:
        return _SPINDLE_TRAVEL, SPINDLE, spindle, limits[MAX_SPINDLE], 0
    if jaw < limits[MIN_JAW]:
        return _JAW_TRAVEL, JAW, jaw, limits[MIN_JAW], 0
    if jaw > limits[MAX_JAW]:
        return _JAW_TRAVEL, JAW, jaw, limits[MAX_JAW], 0
    crossing = motor_crossing(
        guard[MOTOR_WATCH:SENSOR_WATCH],
        limits[MOTOR_LIMITS:CHOICE],
        limits[MAX_STALL],
        TICK_US,
        motor,
        current,
        MOTOR,
        CURRENT,
    )
    if crossing[0] != NONE:
        return crossing
    converted = row[PROXIMAL : CURRENT + 1]
    return sensor_crossing(guard[SENSOR_WATCH:], limits, TICK_US, converted, PROXIMAL, *INT16)


@numba.njit(cache=True)
def first_crossing(
    rows: NDArray[np.int32],
    ticks: NDArray[np.float64],
    guard: NDArray[np.int64],
    limits: NDArray[np.int64],
) -> tuple[int, int, int, int, int, int]:
    """Hold the limits against rows of inputs, for a host that repeats what the board does.

    Args:
        rows: Inputs as counts, shape (n, at least 6).
        ticks: Ticks between each and the one before it, more where samples were lost or late.
        guard: State of the guard, carried from call to call.
        limits: `Limits.as_array`.

    Returns:
        Row, code, channel, value, limit and lateness, us, of the first crossing; row n and code 0
        when there is none.
    """
    for k in range(len(rows)):
        if guard[PRIMED]:
            judge_by_time(guard[MOTOR_WATCH:SENSOR_WATCH], np.int64(rows[k, MOTOR]), ticks[k])
        code, channel, value, limit, late_us = _check(guard, limits, rows[k])
        if code != NONE:
            return k, code, channel, value, limit, late_us
    return len(rows), NONE, NO_CHANNEL, 0, 0, 0


@numba.njit(cache=True)
def run_ticks(
    rows: NDArray[np.int32],
    targets: NDArray[np.int32],
    loads_ma: NDArray[np.int32],
    guard: NDArray[np.int64],
    limits: NDArray[np.int64],
    control_state: NDArray[np.float64],
    gains: NDArray[np.float64],
) -> None:
    """Do a tick behind every row, for benches whose inputs do not follow the motors."""
    for k in range(len(rows)):
        drive_tick(rows[k], targets[k], loads_ma[k], guard, limits, control_state, gains)


def _allows(setpoints: NDArray[np.int64], limits: NDArray[np.int64]) -> bool:
    target, load = setpoints.T
    return bool(
        (np.abs(load) <= limits[_AT["max_load_ma"]]).all()
        and (target >= limits[MIN_SPINDLE]).all()
        and (target <= limits[MAX_SPINDLE]).all()
    )


REFERENCE_LOGIC = BoardLogic(
    profile=REFERENCE,
    idle=Drive,
    armed=lambda gains, limits: Drive.armed(gains[0], Limits(*limits), engaged=False),
    limits_are_valid=lambda limits: Limits(*limits).valid,
    allows=_allows,
    columns={
        name: column
        for column, name in enumerate(
            ("motor", "spindle", "jaw", "proximal", "distal", "current", "fsr")
        )
    }
    | {"command_e4": COMMAND_E4, "load_ma": LOAD_MA, "target": TARGET},
    status_column=STATUS,
    converted={PROXIMAL: INT16, DISTAL: INT16, CURRENT: INT16, FSR: (-(2**32), FSR_MAX)},
)
"""What `drivers.teensy.fake.PythonBoard` does a tick on the reference rig."""
