"""The profile of the reference rig: a drive motor over the spindle, a load motor, 1 kHz.

The board's side is `firmware/core/profile_reference.hpp`.
"""

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.teensy.profile import Profile, choice_is_valid
from drivers.teensy.protocol import (
    CHOICE_NAMES,
    GAIN_NAMES,
    HEADER_FIELDS,
    MOTOR_LIMIT_NAMES,
    SAMPLE_FIELDS,
    TOP,
    WATCHDOG_US,
    SafeState,
    layout,
)

SAMPLE_RATE_HZ = 1000
TICK_US = 1_000_000 // SAMPLE_RATE_HZ
"""Period of a control tick and of a sample, microseconds."""
SAMPLE_DTYPE = layout(
    *SAMPLE_FIELDS,
    "motor i4",
    "spindle i4",
    "jaw i4",
    "target i4",
    "proximal i2",
    "distal i2",
    "current i2",
    "fsr u2",
    "command_e4 i2",
    "load_ma i2",
    "dropped u2",
)
"""One sample, raw counts with the rig's raw signs.

`dropped` counts the frames the board could not queue since it started, modulo 65536. `target` is
the spindle count itself while nothing is asked.
"""
LIMIT_NAMES = (
    "max_current",
    "max_load_ma",
    "max_proximal",
    "max_distal",
    "min_spindle",
    "max_spindle",
    "min_jaw",
    "max_jaw",
    *MOTOR_LIMIT_NAMES,
    *CHOICE_NAMES,
)
ARM_DTYPE = layout(
    *HEADER_FIELDS, *(f"{name} f8" for name in GAIN_NAMES), *(f"{name} i4" for name in LIMIT_NAMES)
)
SETPOINT_DTYPE = layout("target i4", "load_ma i2")
INPUT_NAMES = ("motor", "spindle", "jaw", "proximal", "distal", "current")
"""Fields of a sample a trip can name, in the order of its channel number."""

REFERENCE = Profile(
    "reference",
    "rig teensy protocol 1",
    TICK_US,
    SAMPLE_DTYPE,
    ARM_DTYPE,
    SETPOINT_DTYPE,
    max_setpoints=100,
    motors=1,
    input_names=INPUT_NAMES,
)


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits that the board checks on every sample while armed, in counts.

    What has a default is not held unless it is given.

    Attributes:
        max_current: Largest size of the measured current, counts of 1 mA.
        max_load_ma: Largest size of a load setpoint, mA; a larger one is refused.
        max_proximal: Largest size of the proximal torque, counts.
        max_distal: Largest size of the distal torque, counts.
        min_spindle: Lowest spindle count, for the sample and for a setpoint.
        max_spindle: Highest spindle count.
        min_jaw: Lowest jaw count.
        max_jaw: Highest jaw count.
        max_motor_step: Fastest motor, counts a tick, in three ticks on end.
        continuous_current: Current that warms the motor no further, counts.
        i2t: Heat above it that the motor can take, counts^2 s: the integral of the measured current
            squared less the continuous one squared, never below 0.
        stall_current: Current, counts, above which a motor that does not move is stalled.
        stall_motion: Motor counts within which it does not move.
        stall_ticks: How long it may be stalled.
        saturated_ticks: How long a torque or current count may be at the end of its range.
        stale_ticks: How long a torque or current count may stay the same.
        watchdog_us: How long the host may be silent, 5 ms to 1 s.
        safe_state: `SafeState`. Held are a silent host, a stall, and a saturated or stale sensor;
            any other crossing releases whatever is asked for.
        hold_command_e4: Largest command while holding, 1e-4 of full scale.
    """

    max_current: int
    max_load_ma: int
    max_proximal: int
    max_distal: int
    min_spindle: int
    max_spindle: int
    min_jaw: int = -TOP - 1
    max_jaw: int = TOP
    max_motor_step: int = TOP
    continuous_current: int = TOP
    i2t: int = TOP
    stall_current: int = TOP
    stall_motion: int = 0
    stall_ticks: int = TOP
    saturated_ticks: int = TOP
    stale_ticks: int = TOP
    watchdog_us: int = WATCHDOG_US
    safe_state: int = SafeState.RELEASE
    hold_command_e4: int = 0

    @classmethod
    def widest(cls) -> "Limits":
        """Return limits that nothing can cross: for a board that moves nothing real."""
        return cls(TOP, TOP, TOP, TOP, -TOP - 1, TOP)

    @property
    def valid(self) -> bool:
        """Whether a board accepts them, as `Limits::valid` in the firmware."""
        sizes = (
            *(self.max_current, self.max_load_ma, self.max_proximal, self.max_distal),
            *(self.max_motor_step, self.continuous_current, self.i2t),
            *(self.stall_current, self.stall_motion),
        )
        return (
            min(sizes) >= 0
            and self.min_spindle <= self.max_spindle
            and self.min_jaw <= self.max_jaw
            and choice_is_valid(self)
        )

    def as_array(self) -> NDArray[np.int64]:
        """Return the limits in the order of the wire, shape (19,)."""
        return np.array(astuple(self), np.int64)
