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
    """Limits that the board checks on one motor's counts while armed."""

    max_current: int = TOP  # Largest size of the measured current, counts of 1 mA
    max_force: int = TOP  # Largest force, counts
    # Lowest count of the motor's encoder, for the sample and for a setpoint
    min_motor: int = -TOP - 1
    max_motor: int = TOP  # Highest
    max_motor_step: int = TOP  # Fastest, counts a tick, in three ticks on end
    continuous_current: int = TOP  # Current that warms the motor no further, counts
    i2t: int = TOP  # Heat above it that the motor can take, counts^2 s
    stall_current: int = TOP  # Current, counts, above which a motor that does not move is stalled
    stall_motion: int = 0  # Motor counts within which it does not move
    max_motor_jump: int = TOP  # This and the following as in `drivers.teensy.reference.Limits`
    max_target_step: int = TOP  # Farthest a setpoint may be from the one before it, counts
    max_following: int = TOP  # Farthest the motor may be from its target, counts
    following_ticks: int = TOP  # How long it may be farther
    # Measured current at a command of 10000, counts; 0 for no comparison
    full_scale_current: int = 0
    current_offset: int = 0  # Measured current at a command of 0, counts
    max_current_error: int = TOP  # Largest difference of measured and commanded current, counts
    current_ticks: int = 1  # Ticks over which that difference is averaged
    # Change of the current behind which a still motor has a dead encoder, counts
    frozen_current: int = TOP
    frozen_motion: int = 0  # Motor counts within which it is still


@dataclass(frozen=True, slots=True)
class GrasperLimits:
    """Limits that the board checks on every sample while armed; a missing limit is not checked."""

    # Limits of each motor
    axes: tuple[AxisLimits, AxisLimits, AxisLimits] = (AxisLimits(), AxisLimits(), AxisLimits())
    stall_ticks: int = TOP  # How long a motor may be stalled
    saturated_ticks: int = TOP  # How long a current or force count may be at the end of its range
    stale_ticks: int = TOP  # How long a current or force count may stay the same
    dry_ticks: int = TOP  # How long the last setpoint is held while none follows
    watchdog_us: int = WATCHDOG_US  # How long the host may be silent, 5 ms to 1 s
    safe_state: int = SafeState.RELEASE  # `SafeState`; what is held, holds all three motors
    hold_command_e4: int = 0  # Largest command while holding, 1e-4 of full scale
    hold_ticks: int = TOP  # How long it may hold; then it releases

    def as_array(self) -> NDArray[np.int64]:
        """Return the limits in the order of the wire, shape (65,)."""
        axes, *choice = astuple(self)
        return np.array([*(limit for axis in axes for limit in axis), *choice], np.int64)
