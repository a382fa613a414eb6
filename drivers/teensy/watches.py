"""The watches every profile's guard is made of: of a motor, of sensors, and what a trip does.

`motor_guard.hpp` and `sensor_guard.hpp` of `firmware/core` and the latch of `board.hpp` in Python:
the same integer operations in the same order, so that fake and firmware answer
with the same bytes. Counts and ticks throughout.
"""

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from drivers.teensy.protocol import (
    STATUS_ARMED,
    STATUS_HOLDING,
    STATUS_LIMIT_TRIPPED,
    STATUS_WATCHDOG_TRIPPED,
    TRIP_SHIFT,
    SafeState,
    Trip,
)

(
    STATE,
    ENGAGED,
    SILENT_US,
    PRIMED,
    TICKS,
    TRIP_CODE,
    TRIP_CHANNEL,
    TRIP_VALUE,
    TRIP_LIMIT,
    TRIP_LATE_US,
    TRIP_TICK,
) = range(11)
BOARD_PLACES = 11
"""Places every guard's state begins with, int64."""

LAST_MOTOR, FAST_TICKS, HEAT, HOT_TICKS, STALL_ANCHOR, STALL_TICKS = range(6)
MOTOR_PLACES = 6
"""Places of one motor's watch."""

SATURATED_TICKS = 0
LAST_COUNT = 1
"""Places of a watch of n sensors: 1 + 2 n of them; `LAST_COUNT + n` counts the same ones on end."""

MAX_STEP, CONTINUOUS, I2T, STALL_CURRENT, STALL_MOTION = range(5)
MAX_STALL, MAX_SATURATED, MAX_STALE, WATCHDOG_US, SAFE_STATE, HOLD_COMMAND = range(-6, 0)
"""Places of a motor's limits, and of the choice every profile's limits end with."""

OVER_SPEED_TICKS = 3
LONG_TICK = 1.5
"""Ticks since the last sample from which on a motor's way is judged by the time that has passed."""
NO_CHANNEL = 255
NONE = int(Trip.NONE)
_HOST_SILENT = int(Trip.HOST_SILENT)
_OVER_SPEED = int(Trip.OVER_SPEED)
_OVERHEATED = int(Trip.OVERHEATED)
_STALLED = int(Trip.STALLED)
_SENSOR_SATURATED = int(Trip.SENSOR_SATURATED)
_SENSOR_STALE = int(Trip.SENSOR_STALE)
_HOLD = int(SafeState.HOLD)


def untripped(places: int) -> NDArray[np.int64]:
    """Return the state of a guard that nothing has tripped, shape (places,)."""
    guard = np.zeros(places, np.int64)
    guard[TRIP_CHANNEL] = NO_CHANNEL
    return guard


@numba.njit(cache=True)
def motor_crossing(  # type: ignore[no-untyped-def]
    watch, limits, max_stall, tick_us, motor, current, motor_channel, current_channel
):
    """Hold the limits of speed, heat and stall against one motor's counts of one tick.

    Returns a crossing: code, channel, value, limit and lateness, us; code 0 where there is none.

    Args:
        watch: State of this motor's watch, `MOTOR_PLACES` places, changed in place.
        limits: Its limits, `MAX_STEP` and the names next to it.
        max_stall: Ticks it may be stalled.
        tick_us: Period of a tick.
        motor: Its encoder.
        current: Its measured current.
        motor_channel: Number of the encoder's channel.
        current_channel: Number of the current's channel.
    """
    step = motor - watch[LAST_MOTOR]
    watch[LAST_MOTOR] = motor
    watch[FAST_TICKS] = watch[FAST_TICKS] + 1 if abs(step) > limits[MAX_STEP] else 0
    if watch[FAST_TICKS] >= OVER_SPEED_TICKS:
        late_us = (watch[FAST_TICKS] - 1) * tick_us
        return _OVER_SPEED, motor_channel, step, limits[MAX_STEP], late_us
    ticks_a_second = 1_000_000 // tick_us
    heat = watch[HEAT] + current * current - limits[CONTINUOUS] * limits[CONTINUOUS]
    watch[HEAT] = max(heat, 0)
    watch[HOT_TICKS] = watch[HOT_TICKS] + 1 if watch[HEAT] > 0 else 0
    if watch[HEAT] > limits[I2T] * ticks_a_second:
        late_us = watch[HOT_TICKS] * tick_us
        return _OVERHEATED, current_channel, watch[HEAT] // ticks_a_second, limits[I2T], late_us
    still = abs(motor - watch[STALL_ANCHOR]) <= limits[STALL_MOTION]
    if still and abs(current) >= limits[STALL_CURRENT]:
        watch[STALL_TICKS] += 1
    else:
        watch[STALL_ANCHOR] = motor
        watch[STALL_TICKS] = 0
    if watch[STALL_TICKS] >= max_stall:
        late_us = watch[STALL_TICKS] * tick_us
        return _STALLED, motor_channel, current, limits[STALL_CURRENT], late_us
    return NONE, NO_CHANNEL, 0, 0, 0


@numba.njit(cache=True)
def sensor_crossing(watch, limits, tick_us, counts, first, low, high):  # type: ignore[no-untyped-def]
    """Look for sensors that are at the end of their range, or do not change, for too long.

    Args:
        watch: State of the watch, 1 + 2 n places, changed in place.
        limits: The board's limits; the choice at their end is used.
        tick_us: Period of a tick.
        counts: Their counts, shape (n,).
        first: Number of the first one's channel.
        low: Count from which down one is saturated.
        high: Count from which up one is saturated.
    """
    n = len(counts)
    saturated = n
    for k in range(n - 1, -1, -1):
        if counts[k] <= low or counts[k] >= high:
            saturated = k
    watch[SATURATED_TICKS] = watch[SATURATED_TICKS] + 1 if saturated != n else 0
    if watch[SATURATED_TICKS] >= limits[MAX_SATURATED]:
        late_us = watch[SATURATED_TICKS] * tick_us
        count = np.int64(counts[saturated])
        return _SENSOR_SATURATED, first + saturated, count, limits[MAX_SATURATED], late_us
    for k in range(n):
        count = np.int64(counts[k])
        same = watch[LAST_COUNT + n + k] + 1 if count == watch[LAST_COUNT + k] else 0
        watch[LAST_COUNT + n + k] = same
        watch[LAST_COUNT + k] = count
        if same >= limits[MAX_STALE]:
            return _SENSOR_STALE, first + k, count, limits[MAX_STALE], same * tick_us
    return NONE, NO_CHANNEL, 0, 0, 0


@numba.njit(cache=True)
def judge_by_time(watch, motor, ticks):  # type: ignore[no-untyped-def]
    """Scale a motor's travel to one tick where more time than that has passed.

    Args:
        watch: State of this motor's watch, changed in place.
        motor: Its encoder now.
        ticks: Ticks since the last sample.
    """
    if ticks > LONG_TICK:
        watch[LAST_MOTOR] = motor - round((motor - watch[LAST_MOTOR]) / ticks)


@numba.njit(cache=True)
def note_trip(guard, limits, crossing):  # type: ignore[no-untyped-def]
    """Take a board out of force; the first cause stays. Return whether it is to hold."""
    code, channel, value, limit, late_us = crossing
    holdable = code in (_HOST_SILENT, _STALLED, _SENSOR_SATURATED, _SENSOR_STALE)
    in_force = guard[STATE] & STATUS_ARMED and guard[ENGAGED]
    state = guard[STATE] & ~(STATUS_ARMED | STATUS_HOLDING)
    if guard[TRIP_CODE] == NONE:
        guard[TRIP_CODE] = code
        guard[TRIP_CHANNEL] = channel
        guard[TRIP_VALUE] = value
        guard[TRIP_LIMIT] = limit
        guard[TRIP_LATE_US] = late_us
        guard[TRIP_TICK] = guard[TICKS]
        state |= code << TRIP_SHIFT
        state |= STATUS_WATCHDOG_TRIPPED if code == _HOST_SILENT else STATUS_LIMIT_TRIPPED
    holds = bool(holdable and in_force and limits[SAFE_STATE] == _HOLD)
    guard[STATE] = state | STATUS_HOLDING if holds else state
    guard[ENGAGED] = 0
    return holds


@numba.njit(cache=True)
def silence(guard, limits):  # type: ignore[no-untyped-def]
    """Return the crossing of a host that was silent for too long, and forget the silence."""
    silent_us = guard[SILENT_US]
    guard[SILENT_US] = 0
    if guard[STATE] & STATUS_ARMED and silent_us > 0:
        return _HOST_SILENT, NO_CHANNEL, silent_us, limits[WATCHDOG_US], silent_us
    return NONE, NO_CHANNEL, 0, 0, 0


def is_in_force(state: Any) -> bool:
    """Whether a board in this state may give its motors current."""
    return bool(int(state) & (STATUS_ARMED | STATUS_HOLDING))
