"""The profile of the 3-DOF grasper: three motors, each in a position loop of its own, 2 kHz.

The board's side is `firmware/core/profile_grasper.hpp`. Motor 1 turns the yaw, 2 and 3 the two
jaws. Every motor has its encoder, its current read-back, its force sensor, its limits and its
guard.
"""

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.teensy.profile import Profile
from drivers.teensy.protocol import (
    CHOICE_NAMES,
    GAIN_NAMES,
    LOOP_LIMIT_NAMES,
    MOTOR_LIMIT_NAMES,
    SAMPLE_FIELDS,
    SESSION_FIELDS,
    TOP,
    WATCHDOG_US,
    SafeState,
    layout,
)

MOTORS = (1, 2, 3)
INPUT_NAMES = tuple(f"{what}_{k}" for what in ("motor", "current", "force") for k in MOTORS)
"""Fields of a sample a trip can name, in the order of its channel number."""
AXIS_LIMIT_NAMES = (
    "max_current",
    "max_force",
    "min_motor",
    "max_motor",
    *MOTOR_LIMIT_NAMES,
    *LOOP_LIMIT_NAMES,
)

GRASPER = Profile(
    "grasper",
    "rig teensy protocol 1, grasper",
    500,
    layout(
        *SAMPLE_FIELDS,
        *(f"motor_{k} i4" for k in MOTORS),
        *(f"target_{k} i4" for k in MOTORS),
        *(f"current_{k} i2" for k in MOTORS),
        *(f"force_{k} u2" for k in MOTORS),
        *(f"command_{k}_e4 i2" for k in MOTORS),
        "dropped u2",
    ),
    layout(
        *SESSION_FIELDS,
        *(f"{name}_{k} f8" for k in MOTORS for name in GAIN_NAMES),
        *(f"{name}_{k} i4" for k in MOTORS for name in AXIS_LIMIT_NAMES),
        *(f"{name} i4" for name in CHOICE_NAMES),
    ),
    layout(*(f"target_{k} i4" for k in MOTORS)),
    max_setpoints=50,
    motors=len(MOTORS),
    input_names=INPUT_NAMES,
)


@dataclass(frozen=True, slots=True)
class AxisLimits:
    """Limits that the board checks on one motor's counts while armed.

    Attributes:
        max_current: Largest size of the measured current, counts of 1 mA.
        max_force: Largest force, counts.
        min_motor: Lowest count of the motor's encoder, for the sample and for a setpoint.
        max_motor: Highest.
        max_motor_step: Fastest, counts a tick, in three ticks on end.
        continuous_current: Current that warms the motor no further, counts.
        i2t: Heat above it that the motor can take, counts^2 s.
        stall_current: Current, counts, above which a motor that does not move is stalled.
        stall_motion: Motor counts within which it does not move.
        max_motor_jump: This and the following as in `drivers.teensy.reference.Limits`.
        max_target_step: Farthest a setpoint may be from the one before it, counts.
        max_following: Farthest the motor may be from its target, counts.
        following_ticks: How long it may be farther.
        full_scale_current: Measured current at a command of 10000, counts; 0 for no comparison.
        current_offset: Measured current at a command of 0, counts.
        max_current_error: Largest difference of measured and commanded current, counts.
        current_ticks: Ticks over which that difference is averaged.
        frozen_current: Change of the current behind which a still motor has a dead encoder, counts.
        frozen_motion: Motor counts within which it is still.
    """

    max_current: int = TOP
    max_force: int = TOP
    min_motor: int = -TOP - 1
    max_motor: int = TOP
    max_motor_step: int = TOP
    continuous_current: int = TOP
    i2t: int = TOP
    stall_current: int = TOP
    stall_motion: int = 0
    max_motor_jump: int = TOP
    max_target_step: int = TOP
    max_following: int = TOP
    following_ticks: int = TOP
    full_scale_current: int = 0
    current_offset: int = 0
    max_current_error: int = TOP
    current_ticks: int = 1
    frozen_current: int = TOP
    frozen_motion: int = 0


@dataclass(frozen=True, slots=True)
class GrasperLimits:
    """Limits that the board checks on every sample while armed; a missing limit is not checked.

    Attributes:
        axes: Limits of each motor.
        stall_ticks: How long a motor may be stalled.
        saturated_ticks: How long a current or force count may be at the end of its range.
        stale_ticks: How long a current or force count may stay the same.
        dry_ticks: How long the last setpoint is held while none follows.
        watchdog_us: How long the host may be silent, 5 ms to 1 s.
        safe_state: `SafeState`; what is held, holds all three motors.
        hold_command_e4: Largest command while holding, 1e-4 of full scale.
        hold_ticks: How long it may hold; then it releases.
        seek: 0; a grasper is referenced by hand.
    """

    axes: tuple[AxisLimits, AxisLimits, AxisLimits] = (AxisLimits(), AxisLimits(), AxisLimits())
    stall_ticks: int = TOP
    saturated_ticks: int = TOP
    stale_ticks: int = TOP
    dry_ticks: int = TOP
    watchdog_us: int = WATCHDOG_US
    safe_state: int = SafeState.RELEASE
    hold_command_e4: int = 0
    hold_ticks: int = TOP
    seek: int = 0

    def as_array(self) -> NDArray[np.int64]:
        """Return the limits in the order of the wire, shape (65,)."""
        axes, *choice = astuple(self)
        return np.array([*(limit for axis in axes for limit in axis), *choice], np.int64)
