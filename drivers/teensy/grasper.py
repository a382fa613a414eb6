"""The profile of the 3-DOF grasper: three motors, each in a position loop of its own, 2 kHz.

The board's side is `firmware/core/profile_grasper.hpp`. Motor 1 turns the yaw, 2 and 3 the two
jaws. Every motor has its encoder, its current read-back, its force sensor, its limits and its
guard.
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

MOTORS = (1, 2, 3)
INPUT_NAMES = tuple(f"{what}_{k}" for what in ("motor", "current", "force") for k in MOTORS)
"""Fields of a sample a trip can name, in the order of its channel number."""


@dataclass(frozen=True, kw_only=True)
class AxisLimits(LoopLimits):
    """Limits that the board checks on one motor's counts while armed."""

    max_current: int = TOP  # largest size of the measured current, counts of 1 mA
    max_force: int = TOP  # largest force, counts
    # lowest count of the motor's encoder, for the sample and for a setpoint
    min_motor: int = -TOP - 1
    max_motor: int = TOP  # highest


AXIS_LIMIT_NAMES = (*AxisLimits.__annotations__, *MOTOR_LIMIT_NAMES, *LOOP_LIMIT_NAMES)
"""The order of the wire."""

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


@dataclass(frozen=True)
class GrasperLimits(Choices):
    """Limits that the board checks on every sample while armed; a missing limit is not checked."""

    # limits of each motor; what is held, holds all three
    axes: tuple[AxisLimits, AxisLimits, AxisLimits] = (AxisLimits(), AxisLimits(), AxisLimits())

    def as_array(self) -> NDArray[np.int64]:
        """Return the limits in the order of the wire, shape (66,)."""
        limits = [getattr(axis, name) for axis in self.axes for name in AXIS_LIMIT_NAMES]
        return np.array([*limits, *(getattr(self, name) for name in CHOICE_NAMES)], np.int64)
