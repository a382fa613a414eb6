"""The profile of the reference rig: a drive motor over the spindle, a load motor, 1 kHz.

The board's side is `firmware/core/profile_reference.hpp`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.teensy.profile import (
    CHOICE_NAMES,
    LOOP_LIMIT_NAMES,
    MOTOR_LIMIT_NAMES,
    Choices,
    LoopLimits,
    Profile,
)
from drivers.teensy.protocol import GAIN_NAMES, SAMPLE_FIELDS, SESSION_FIELDS, TOP, layout

SAMPLE_RATE_HZ = 1000
TICK_US = 1_000_000 // SAMPLE_RATE_HZ
"""Period of a control tick and of a sample, microseconds."""
SAMPLE_DTYPE = layout(
    *(*SAMPLE_FIELDS, "motor i4", "spindle i4", "jaw i4", "target i4"),
    *("proximal i2", "distal i2", "current i2", "fsr u2"),
    *("command_e4 i2", "load_ma i2", "dropped u2"),
)
"""One sample, raw counts with the rig's raw signs.

`dropped` counts the frames the board could not queue since it started, modulo 65536. `target` is
the spindle count itself while nothing is asked.
"""


@dataclass(frozen=True, kw_only=True)
class Limits(LoopLimits, Choices):
    """Limits that the board checks on every sample while armed, in counts.

    One that is not given is not held.
    """

    max_current: int = TOP  # largest size of the measured current, counts of 1 mA
    max_load_ma: int = TOP  # largest size of a load setpoint, mA; a larger one is refused
    max_proximal: int = TOP  # largest size of the proximal torque, counts
    max_distal: int = TOP  # largest size of the distal torque, counts
    min_spindle: int = -TOP - 1  # lowest spindle count, for the sample and for a setpoint
    max_spindle: int = TOP  # highest spindle count
    min_jaw: int = -TOP - 1  # lowest jaw count
    max_jaw: int = TOP  # highest jaw count
    continuous_load_ma: int = TOP  # load setpoint that warms the load motor no further, mA
    load_i2t: int = TOP  # heat above it that the load motor can take, mA^2 s
    # counts of the motor, signed, for a turn of the spindle; motor and spindle are not compared
    # where this is 0, jaw and spindle where `jaw_per_turn` is
    motor_per_turn: int = 0
    spindle_per_turn: int = 0  # counts of the spindle, signed, for the same turn
    jaw_per_turn: int = 0  # counts of the jaw, signed, for the same turn
    twist_e6: int = 0  # counts the motor is ahead for 1e6 counts of proximal torque, signed
    stretch_e6: int = 0  # counts the jaw is ahead for 1e6 counts of distal torque, signed
    # largest span of what motor and spindle differ by otherwise and besides half of that twist,
    # motor counts
    max_twist: int = TOP
    max_stretch: int = TOP  # the same of jaw and spindle, jaw counts; the jaw's may be 30 ms old
    max_spindle_jump: int = TOP  # farthest the spindle's count may go in one tick
    max_jaw_jump: int = TOP  # farthest the jaw's count may go in one tick
    # proximal counts, signed, that 1000 counts of current make at rest; 0 where they are not
    # compared
    torque_e3: int = 0
    # largest difference of both, besides half of what the current makes, while no encoder counts,
    # proximal counts
    max_still_torque: int = TOP
    max_still_change: int = TOP  # farthest the proximal torque may change meanwhile
    # farthest that difference may rise meanwhile the way the motor turned last
    max_still_rise: int = TOP
    jaw_zero: int = 0  # jaw count at spindle count 0 with no distal torque
    # farthest beyond its travel the spindle may be as the jaw shows it, spindle counts
    max_beyond: int = TOP
    # Distance to the end of the travel towards which the spindle is to turn, counts, within which
    # encoders may not count for 30 ticks, or ten times so long at the target. Then the motor pulls
    # away from that end; 10 ticks without a count are then a dead encoder.
    probe_within: int = 0
    # ticks more for each 1000 counts farther from that end; `TOP` for no such pull anywhere
    probe_patience: int = TOP

    def as_array(self) -> NDArray[np.int64]:
        """Return the limits in the order of the wire, shape (51,)."""
        return np.array([getattr(self, name) for name in LIMIT_NAMES], np.int64)


_OWN = tuple(Limits.__annotations__)
LIMIT_NAMES = (*_OWN[:10], *MOTOR_LIMIT_NAMES, *LOOP_LIMIT_NAMES, *_OWN[10:], *CHOICE_NAMES)
"""The order of the wire."""
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
