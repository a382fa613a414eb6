"""Kinds of hidden effects: their names and the ranges of the numbers that shape each.

What each does is in its function, in `hidden_drive`, `hidden_cable` or `hidden_sensors`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Shape:
    """One number that shapes an effect: what it is, with its unit, and the range it is drawn from.

    Attributes:
        name: Name with the unit.
        low: Smallest value drawn.
        high: Largest value drawn.
        whole: Whole numbers only.
    """

    name: str
    low: float
    high: float
    whole: bool = False

    @property
    def middle(self) -> float:
        """The value used when none is given."""
        return self.rounded(0.5 * (self.low + self.high))

    def rounded(self, value: float) -> float:
        """Return a value as this number may have it."""
        return float(round(value)) if self.whole else value

    def drawn(self, random: np.random.Generator) -> float:
        """Return a value drawn from the range."""
        return self.rounded(float(random.uniform(self.low, self.high)))


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of hidden effect.

    Attributes:
        name: Name in the configuration.
        shapes: Up to two numbers of its row.
        strongest: Largest strength `hidden.draw` gives.
        alone: Whether it shows in a campaign of usual runs, so that `hidden.draw` may pick it:
            alike in all runs, with the wrist held.
    """

    name: str
    shapes: tuple[Shape, ...]
    strongest: float = 1.4
    alone: bool = True


WEAKEST = 0.7
"""Smallest strength `hidden.draw` gives."""


def _kind(name: str, *shapes: Shape, strongest: float = 1.4, alone: bool = True) -> Kind:
    return Kind(name, shapes, strongest, alone)


_ORDER = Shape("periods_per_turn", 2.0, 6.0, whole=True)
_PHASE = Shape("phase_rad", 0.0, 2.0 * math.pi)
_SPOT = Shape("spindle_angle_rad", -0.75, -0.3)

KINDS = (
    _kind("motor_ripple", _ORDER, _PHASE),
    _kind("gear_load_friction", Shape("knee_torque_n_m", 0.02, 0.05)),
    _kind("gear_stribeck", Shape("motor_speed_rad_s", 6.0, 14.0)),
    _kind(
        "gear_backlash",
        Shape("half_gap_rad", 0.005, 0.01),
        Shape("contact_damping_s_rad", 0.01, 0.05),
    ),
    _kind("gear_eccentricity", Shape("periods_per_turn", 12.0, 20.0, whole=True), _PHASE),
    _kind("torque_constant_sag", Shape("current_a", 0.1, 0.3)),
    _kind("current_sensor_bend", Shape("current_a", 0.08, 0.2)),
    _kind("cable_position_friction", _SPOT, Shape("width_rad", 0.1, 0.25)),
    _kind("cable_presliding", Shape("displacement_rad", 0.1, 0.3)),
    _kind("cable_creep", Shape("time_s", 0.3, 1.5)),
    _kind("jaw_spring", Shape("rest_angle_rad", 0.5, 1.0), Shape("softening_rad", 0.3, 0.8)),
    _kind("end_stop_spring", Shape("contact_angle_rad", 0.8, 1.0)),
    _kind("motor_asymmetry", Shape("motor_speed_rad_s", 0.5, 2.0)),
    _kind("motor_drag", Shape("motor_speed_rad_s", 16.0, 24.0)),
    _kind("current_ripple", _ORDER, _PHASE),
    _kind("winding_heat", Shape("time_s", 3.0, 8.0)),
    _kind("torque_lag", Shape("time_s", 0.0014, 0.0022), strongest=1.2),
    _kind("gear_stiffening", Shape("twist_rad", 0.008, 0.016)),
    _kind("gear_two_state", Shape("motor_speed_rad_s", 12.0, 20.0)),
    _kind("gear_angle_viscous", Shape("spindle_angle_rad", -0.65, -0.4)),
    _kind(
        "cable_growing_friction",
        Shape("spindle_angle_rad", -1.2, -1.0),
        Shape("width_rad", 0.3, 0.6),
    ),
    _kind("cable_load_notch", _SPOT, Shape("width_rad", 0.1, 0.2)),
    _kind("friction_step", Shape("time_s", 5.0, 10.0)),
    _kind("cable_hysteresis", Shape("stretch_rad", 0.02, 0.04)),
    _kind("spindle_ripple", Shape("periods_per_turn", 12.0, 30.0), _PHASE),
    _kind("eccentric_pulley", Shape("periods_per_turn", 7.0, 14.0), _PHASE),
    _kind("jaw_mass"),
    _kind("jaw_detent", Shape("jaw_angle_rad", 0.5, 0.9), Shape("width_rad", 0.08, 0.16)),
    _kind("proximal_bend", Shape("torque_n_m", 0.08, 0.15)),
    _kind("proximal_creep", Shape("time_s", 0.4, 1.2)),
    _kind("proximal_lag", Shape("time_s", 0.02, 0.04)),
    _kind("distal_drift", Shape("time_s", 3.0, 9.0)),
    _kind("distal_crosstalk", Shape("current_a", 0.2, 0.5)),
    _kind("jaw_delay", Shape("delay_tick", 12.0, 28.0)),
    _kind("jaw_encoder_wave", Shape("periods_per_turn", 10.0, 24.0), _PHASE),
    _kind("motor_viscous_asymmetry", Shape("motor_speed_rad_s", 1.0, 4.0)),
    _kind("gear_load_viscous", Shape("motor_speed_rad_s", 60.0, 120.0)),
    _kind("grease_warmup", Shape("time_s", 2.0, 6.0)),
    _kind("gear_wear", alone=False),
    _kind("cable_stiff", alone=False),
    _kind("cable_dwell", Shape("slip_rad", 0.05, 0.15)),
    _kind("cable_capstan", Shape("wrap", 0.4, 0.6)),
    _kind("wrist_capstan", Shape("friction", 0.7, 1.0), alone=False),
    _kind("wrist_pull", Shape("bow", 0.1, 0.4), alone=False),
    _kind(
        "wrist_pinch",
        Shape("wrist_angle_rad", -0.25, 0.25),
        Shape("width_rad", 0.1, 0.2),
        alone=False,
    ),
    _kind("jaw_weight", Shape("level_angle_rad", 0.5, 0.9)),
)
"""Every kind of hidden effect."""

SUMS = {
    "motor_friction": (
        "gear_load_friction", "gear_stribeck", "motor_asymmetry", "motor_drag", "gear_two_state",
        "gear_angle_viscous", "motor_viscous_asymmetry", "gear_load_viscous", "grease_warmup",
        "gear_wear",
    ),
    "spindle_friction": (
        "cable_position_friction", "cable_growing_friction", "cable_load_notch", "friction_step",
        "cable_stiff", "cable_dwell", "cable_capstan", "wrist_capstan", "wrist_pinch",
    ),
    "jaw_torque": ("jaw_spring", "end_stop_spring", "jaw_detent", "jaw_weight"),
}  # fmt: skip
"""What is worked out only where one of these is on."""

TABLE = np.dtype(
    [(kind.name, np.float64, 3) for kind in KINDS] + [(name, np.bool_) for name in SUMS]
)
"""The effects as compiled code reads them: a row of each, and whether any of a sum is on."""

STRENGTH, FIRST, SECOND = range(3)
"""Places in a row."""

Row = Sequence[float]
"""One row of the table; the compiled code passes an array."""
