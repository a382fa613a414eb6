"""Kinds of hidden effects: name, description, and the ranges of the numbers that shape each.

Each name here is the row of its kind in `hidden.table`, for compiled code.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


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
        middle = 0.5 * (self.low + self.high)
        return float(round(middle)) if self.whole else middle


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of hidden effect.

    Attributes:
        name: Name in the configuration.
        description: Description and shape parameters.
        shapes: Up to two numbers of its row.
        weakest: Smallest strength `draw` gives.
        strongest: Largest strength `draw` gives.
        alone: Whether it shows in a campaign of usual runs, so that `draw` may pick it: alike in
            all runs, with the wrist held.
    """

    name: str
    description: str
    shapes: tuple[Shape, ...]
    weakest: float = 0.7
    strongest: float = 1.4
    alone: bool = True


_PHASE = Shape("phase_rad", 0.0, 2.0 * math.pi)

KINDS: list[Kind] = []
"""Every kind of hidden effect; the place in this list is the row of the table."""

STRENGTH, FIRST, SECOND = range(3)
"""Columns of the table the compiled code reads."""

Row = Sequence[float]
"""One row of the table; the compiled code passes a row of the array."""


def _kind(name: str, description: str, *shapes: Shape, **others: Any) -> int:
    """Add a kind and return its row."""
    KINDS.append(Kind(name, description, shapes, **others))
    return len(KINDS) - 1


MOTOR_RIPPLE = _kind(
    "motor_ripple",
    "torque ripple of the motor, k periods per turn, amplitude modulated once per turn",
    Shape("periods_per_turn", 2.0, 6.0, whole=True),
    _PHASE,
)
GEAR_LOAD_FRICTION = _kind(
    "gear_load_friction",
    "gear friction that grows with the torque the gear carries, softly at first",
    Shape("knee_torque_n_m", 0.02, 0.05),
)
GEAR_STRIBECK = _kind(
    "gear_stribeck",
    "extra friction of motor and gear at low speed",
    Shape("motor_speed_rad_s", 6.0, 14.0),
)
GEAR_BACKLASH = _kind(
    "gear_backlash",
    "lost motion in the gear, contact with damping that grows with penetration",
    Shape("half_gap_rad", 5e-3, 10e-3),
    Shape("contact_damping_s_rad", 0.01, 0.05),
)
GEAR_ECCENTRICITY = _kind(
    "gear_eccentricity",
    "periodic error of the gear's position along the spindle angle, with a second harmonic",
    Shape("periods_per_turn", 12.0, 20.0, whole=True),
    _PHASE,
)
TORQUE_CONSTANT_SAG = _kind(
    "torque_constant_sag", "torque constant that falls with current", Shape("current_a", 0.1, 0.3)
)
CURRENT_SENSOR_BEND = _kind(
    "current_sensor_bend",
    "gain of the current sensor that rises with current",
    Shape("current_a", 0.08, 0.2),
)
CABLE_POSITION_FRICTION = _kind(
    "cable_position_friction",
    "tight spot of the cable at one spindle angle",
    Shape("spindle_angle_rad", -0.75, -0.3),
    Shape("width_rad", 0.1, 0.25),
)
CABLE_PRESLIDING = _kind(
    "cable_presliding",
    "friction of the cable that builds up over a displacement after each reversal",
    Shape("displacement_rad", 0.1, 0.3),
)
CABLE_CREEP = _kind(
    "cable_creep",
    "part of the cable's tension that relaxes, faster when it is large",
    Shape("time_s", 0.3, 1.5),
)
JAW_SPRING = _kind(
    "jaw_spring",
    "softening spring between jaw and ground",
    Shape("rest_angle_rad", 0.5, 1.0),
    Shape("softening_rad", 0.3, 0.8),
)
END_STOP_SPRING = _kind(
    "end_stop_spring",
    "spring of rising stiffness near the closed end",
    Shape("contact_angle_rad", 0.8, 1.0),
)
MOTOR_ASYMMETRY = _kind(
    "motor_asymmetry",
    "extra friction of the motor on opening",
    Shape("motor_speed_rad_s", 0.5, 2.0),
)
MOTOR_DRAG = _kind(
    "motor_drag",
    "friction of motor and gear that rises faster than the speed",
    Shape("motor_speed_rad_s", 16.0, 24.0),
)
CURRENT_RIPPLE = _kind(
    "current_ripple",
    "torque constant that ripples k times a motor turn, modulated once a turn",
    Shape("periods_per_turn", 2.0, 6.0, whole=True),
    _PHASE,
)
WINDING_HEAT = _kind(
    "winding_heat", "torque constant that falls as the winding warms", Shape("time_s", 3.0, 8.0)
)
TORQUE_LAG = _kind(
    "torque_lag",
    "motor torque behind the measured current by two lags in a row",
    Shape("time_s", 1.4e-3, 2.2e-3),
    strongest=1.2,
)
GEAR_STIFFENING = _kind(
    "gear_stiffening", "gear that grows stiffer with its twist", Shape("twist_rad", 8e-3, 16e-3)
)
GEAR_TWO_STATE = _kind(
    "gear_two_state",
    "friction that switches on at high speed and off at low speed",
    Shape("motor_speed_rad_s", 12.0, 20.0),
)
GEAR_ANGLE_VISCOUS = _kind(
    "gear_angle_viscous",
    "viscous friction beyond one spindle angle",
    Shape("spindle_angle_rad", -0.65, -0.4),
)
CABLE_GROWING_FRICTION = _kind(
    "cable_growing_friction",
    "friction of the cable that grows along its travel",
    Shape("spindle_angle_rad", -1.2, -1.0),
    Shape("width_rad", 0.3, 0.6),
)
CABLE_LOAD_NOTCH = _kind(
    "cable_load_notch",
    "worn spot of the cable that rubs in proportion to its tension",
    Shape("spindle_angle_rad", -0.75, -0.3),
    Shape("width_rad", 0.1, 0.2),
)
FRICTION_STEP = _kind(
    "friction_step", "friction of the cable that rises at one time", Shape("time_s", 5.0, 10.0)
)
CABLE_HYSTERESIS = _kind(
    "cable_hysteresis",
    "wires that rub on each other while the cable is stretched",
    Shape("stretch_rad", 0.02, 0.04),
)
SPINDLE_RIPPLE = _kind(
    "spindle_ripple",
    "torque ripple along the spindle angle, k periods per turn, with a second harmonic",
    Shape("periods_per_turn", 12.0, 30.0),
    _PHASE,
)
ECCENTRIC_PULLEY = _kind(
    "eccentric_pulley",
    "pulley whose lever arm varies along the spindle angle",
    Shape("periods_per_turn", 7.0, 14.0),
    _PHASE,
)
JAW_MASS = _kind("jaw_mass", "mass that moves with the jaw")
JAW_DETENT = _kind(
    "jaw_detent",
    "notch the jaw falls into",
    Shape("jaw_angle_rad", 0.5, 0.9),
    Shape("width_rad", 0.08, 0.16),
)
PROXIMAL_BEND = _kind(
    "proximal_bend",
    "gain of the spindle's torque sensor that rises with torque",
    Shape("torque_n_m", 0.08, 0.15),
)
PROXIMAL_CREEP = _kind(
    "proximal_creep", "creep of the spindle's torque sensor", Shape("time_s", 0.4, 1.2)
)
PROXIMAL_LAG = _kind(
    "proximal_lag", "spindle's torque sensor behind two lags in a row", Shape("time_s", 0.02, 0.04)
)
DISTAL_DRIFT = _kind(
    "distal_drift",
    "drift of the jaw torque sensor's zero, fast at first",
    Shape("time_s", 3.0, 9.0),
)
DISTAL_CROSSTALK = _kind(
    "distal_crosstalk",
    "motor current that the jaw's torque sensor picks up",
    Shape("current_a", 0.2, 0.5),
)
JAW_DELAY = _kind(
    "jaw_delay",
    "jaw encoder that answers late, smeared over three ticks",
    Shape("delay_tick", 12.0, 28.0),
)
JAW_ENCODER_WAVE = _kind(
    "jaw_encoder_wave",
    "error of the jaw encoder along its own angle, with a second harmonic",
    Shape("periods_per_turn", 10.0, 24.0),
    _PHASE,
)
MOTOR_VISCOUS_ASYMMETRY = _kind(
    "motor_viscous_asymmetry",
    "viscous friction of motor and gear on opening",
    Shape("motor_speed_rad_s", 1.0, 4.0),
)
GEAR_LOAD_VISCOUS = _kind(
    "gear_load_viscous",
    "gear friction that grows with torque and with speed, less so when fast",
    Shape("motor_speed_rad_s", 60.0, 120.0),
)
GREASE_WARMUP = _kind(
    "grease_warmup", "friction of cold grease that fades within the run", Shape("time_s", 2.0, 6.0)
)
GEAR_WEAR = _kind("gear_wear", "friction of motor and gear beyond the usual", alone=False)
CABLE_STIFF = _kind("cable_stiff", "friction of the cable beyond the usual", alone=False)
CABLE_DWELL = _kind(
    "cable_dwell",
    "friction of the cable that ages with the logarithm of the time at rest",
    Shape("slip_rad", 0.05, 0.15),
)
CABLE_CAPSTAN = _kind(
    "cable_capstan",
    "cable wrapped on a guide: more is lost on closing than on opening",
    Shape("wrap", 0.4, 0.6),
)
WRIST_CAPSTAN = _kind(
    "wrist_capstan",
    "cable wrapped over its guide by the wrist's angle",
    Shape("friction", 0.7, 1.0),
    alone=False,
)
WRIST_PULL = _kind(
    "wrist_pull", "cable that the wrist winds up as it turns", Shape("bow", 0.1, 0.4), alone=False
)
WRIST_PINCH = _kind(
    "wrist_pinch",
    "cable that is pinched at one angle of the wrist",
    Shape("wrist_angle_rad", -0.25, 0.25),
    Shape("width_rad", 0.1, 0.2),
    alone=False,
)
JAW_WEIGHT = _kind(
    "jaw_weight",
    "weight on the jaw whose arm shortens as it falls",
    Shape("level_angle_rad", 0.5, 0.9),
)
