"""The profile of the reference rig: a drive motor over the spindle, a load motor, 1 kHz.

The board's side is `firmware/core/profile_reference.hpp`.
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
    "continuous_load_ma",
    "load_i2t",
    *MOTOR_LIMIT_NAMES,
    *LOOP_LIMIT_NAMES,
    "motor_per_turn",
    "spindle_per_turn",
    "jaw_per_turn",
    "twist_e6",
    "stretch_e6",
    "max_twist",
    "max_stretch",
    "max_spindle_jump",
    "max_jaw_jump",
    "torque_e3",
    "max_still_torque",
    "max_still_change",
    "max_still_rise",
    "jaw_zero",
    "max_beyond",
    "probe_within",
    "probe_patience",
    *CHOICE_NAMES,
)
ARM_DTYPE = layout(
    *SESSION_FIELDS, *(f"{name} f8" for name in GAIN_NAMES), *(f"{name} i4" for name in LIMIT_NAMES)
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
    further_names=("load_ma",),
)


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits that the board checks on every sample while armed, in counts.

    One that is not given is not held.

    Attributes:
        max_current: Largest size of the measured current, counts of 1 mA.
        max_load_ma: Largest size of a load setpoint, mA; a larger one is refused.
        max_proximal: Largest size of the proximal torque, counts.
        max_distal: Largest size of the distal torque, counts.
        min_spindle: Lowest spindle count, for the sample and for a setpoint.
        max_spindle: Highest spindle count.
        min_jaw: Lowest jaw count.
        max_jaw: Highest jaw count.
        continuous_load_ma: Load setpoint that warms the load motor no further, mA.
        load_i2t: Heat above it that the load motor can take, mA^2 s.
        max_motor_step: Fastest motor, counts a tick, in three ticks on end.
        continuous_current: Current that warms the motor no further, counts.
        i2t: Heat above it that the motor can take, counts^2 s: the integral of the measured current
            squared less the continuous one squared, never below 0.
        stall_current: Current, counts, above which a motor that does not move is stalled.
        stall_motion: Motor counts within which it does not move.
        max_motor_jump: Farthest the motor's count may go in one tick.
        max_target_step: Farthest a setpoint may be from the one before it, counts; the first after
            arming may be `max_following` from where the shaft stands.
        max_following: Farthest the spindle may be from its target, counts.
        following_ticks: How long it may be farther.
        full_scale_current: Measured current at a command of 10000, counts, signed; 0 where current
            and command are not compared.
        current_offset: Measured current at a command of 0, counts.
        max_current_error: Largest difference between measured and commanded current, counts.
        current_ticks: Ticks over which that difference is averaged.
        frozen_current: Change of the current, counts, behind which a motor that did not move has a
            dead encoder.
        frozen_motion: Motor counts within which it did not move.
        motor_per_turn: Counts of the motor, signed, for a turn of the spindle; motor and spindle
            are not compared where this is 0, jaw and spindle where `jaw_per_turn` is.
        spindle_per_turn: Counts of the spindle, signed, for the same turn.
        jaw_per_turn: Counts of the jaw, signed, for the same turn.
        twist_e6: Counts the motor is ahead for 1e6 counts of proximal torque, signed.
        stretch_e6: Counts the jaw is ahead for 1e6 counts of distal torque, signed.
        max_twist: Largest span of what motor and spindle differ by otherwise and besides half of
            that twist, motor counts.
        max_stretch: The same of jaw and spindle, jaw counts; the jaw's may be 30 ms old.
        max_spindle_jump: Farthest the spindle's count may go in one tick.
        max_jaw_jump: Farthest the jaw's count may go in one tick.
        torque_e3: Proximal counts, signed, that 1000 counts of current make at rest; 0 where they
            are not compared.
        max_still_torque: Largest difference of both, besides half of what the current makes, while
            no encoder counts, proximal counts.
        max_still_change: Farthest the proximal torque may change meanwhile.
        max_still_rise: Farthest that difference may rise meanwhile the way the motor turned last.
        jaw_zero: Jaw count at spindle count 0 with no distal torque.
        max_beyond: Farthest beyond its travel the spindle may be as the jaw shows it, spindle
            counts.
        probe_within: Distance to the end of the travel towards which the spindle is to turn,
            counts, within which encoders may not count for 30 ticks, or ten times so long at the
            target. Then the motor pulls away from that end; 10 ticks without a count are then a
            dead encoder.
        probe_patience: Ticks more for each 1000 counts farther from that end; `TOP` for no such
            pull anywhere.
        stall_ticks: How long it may be stalled.
        saturated_ticks: How long a torque or current count may be at the end of its range.
        stale_ticks: How long a torque or current count may stay the same.
        dry_ticks: How long the last setpoint is held while none follows.
        watchdog_us: How long the host may be silent, 5 ms to 1 s.
        safe_state: `SafeState`. Held are a silent host, a stall, and a saturated or stale sensor;
            any other crossing releases whatever is asked for.
        hold_command_e4: Largest command while holding, 1e-4 of full scale.
        hold_ticks: How long it may hold; then it releases.
        seek: 1 to move without a reference, towards a stop: the controller's limit is then no
            larger than `hold_command_e4`, and the board has no reference from then on.
    """

    max_current: int = TOP
    max_load_ma: int = TOP
    max_proximal: int = TOP
    max_distal: int = TOP
    min_spindle: int = -TOP - 1
    max_spindle: int = TOP
    min_jaw: int = -TOP - 1
    max_jaw: int = TOP
    continuous_load_ma: int = TOP
    load_i2t: int = TOP
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
    motor_per_turn: int = 0
    spindle_per_turn: int = 0
    jaw_per_turn: int = 0
    twist_e6: int = 0
    stretch_e6: int = 0
    max_twist: int = TOP
    max_stretch: int = TOP
    max_spindle_jump: int = TOP
    max_jaw_jump: int = TOP
    torque_e3: int = 0
    max_still_torque: int = TOP
    max_still_change: int = TOP
    max_still_rise: int = TOP
    jaw_zero: int = 0
    max_beyond: int = TOP
    probe_within: int = 0
    probe_patience: int = TOP
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
        """Return the limits in the order of the wire, shape (51,)."""
        return np.array(astuple(self), np.int64)
