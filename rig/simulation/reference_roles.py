"""The effects of the catalogue that apply to an equation of the reference rig, and their channels.

Speed comes from the motor's encoder; after the gearbox from the spindle's: gear wind-up turns the
motor and not the spindle, and the jaw's coarse encoder causes an apparent delay. A load is never
the target of the same equation: noise shared by both sides of an equation looks like an effect.
"""

from collections.abc import Collection, Mapping
from itertools import product

from estimation.derived import measured_channels
from estimation.effects import catalogue
from estimation.model import Term

MOTOR_LOAD, CABLE_LOAD, CABLE_ANGLE = "motor_load_n_m", "cable_load_n_m", "cable_angle_rad"
"""Loads and an angle that nominal constants predict from one sensor: they replace a target."""

_MOTION = {
    "speed": ("motor_velocity_rad_s",),
    "acceleration": ("motor_acceleration_rad_s2",),
    "position": ("spindle_angle_rad",),
    "travel": ("spindle_angle_rad",),
    "motor_angle": ("motor_angle_rad",),
    "output_angle": ("spindle_angle_rad",),
    "current": ("motor_current_a",),
    "drive": ("motor_current_a",),
    "temperature": ("motor_temperature_k",),
    "clock": ("time_s",),
    "elapsed": ("time_s", "campaign_time_s"),
    "campaign_clock": ("campaign_time_s",),
    "other_angle": ("wrist_pitch_rad", "wrist_roll_rad"),
}

_BEHIND_THE_GEAR = _MOTION | {
    "speed": ("spindle_velocity_rad_s",),
    # of the jaw, which oscillates on its cable
    "acceleration": ("motor_acceleration_rad_s2", "jaw_acceleration_rad_s2"),
}

CHANNELS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "motor": _MOTION
    | {
        "travel": ("motor_angle_rad",),
        "load": (MOTOR_LOAD,),
        "reading": ("motor_current_a", MOTOR_LOAD),
        "creeping": (MOTOR_LOAD,),
        "other_reading": ("jaw_angle_rad",),
        "encoder": ("motor_angle_rad",),
        "stop": ("jaw_angle_rad",),
        "tilt": ("jaw_angle_rad",),
    },
    "gearbox": _MOTION
    | {
        "load": ("proximal_torque_n_m",),
        "travel": ("proximal_torque_n_m",),
        "reading": ("proximal_torque_n_m",),
        "creeping": ("proximal_torque_n_m",),
        "other_reading": ("motor_current_a", "distal_torque_n_m"),
        "encoder": ("motor_angle_rad", "spindle_angle_rad"),
    },
    "cable": _BEHIND_THE_GEAR
    | {
        "load": ("distal_torque_n_m",),
        "reading": ("distal_torque_n_m", CABLE_LOAD),
        "creeping": ("distal_torque_n_m", CABLE_LOAD),
        "other_reading": ("motor_current_a",),
        "encoder": ("spindle_angle_rad",),
        "stop": ("jaw_angle_rad",),
        "tilt": ("jaw_angle_rad",),
    },
    "stretch": _BEHIND_THE_GEAR
    | {
        "load": ("distal_torque_n_m",),
        "travel": ("spindle_angle_rad",),
        "reading": ("distal_torque_n_m", "spindle_angle_rad"),
        "creeping": ("distal_torque_n_m",),
        "other_reading": ("proximal_torque_n_m", "motor_current_a"),
        "encoder": ("spindle_angle_rad", CABLE_ANGLE),
        "stop": ("spindle_angle_rad",),
    },
    "grasp": _MOTION
    | {
        "load": (MOTOR_LOAD,),
        "reading": ("motor_current_a",),
        "other_reading": ("spindle_angle_rad",),
        "encoder": ("motor_angle_rad",),
        "stop": ("jaw_angle_rad",),
        "tilt": ("spindle_angle_rad",),
    },
}
"""Equation to role to channels; each channel is one alternative for the role."""


def candidates(
    equation: str,
    available: Collection[str],
    instead: Mapping[str, str] | None = None,
    at_rest: bool = False,
) -> list[Term]:
    """Return the terms that may be added to an equation of `CHANNELS`, without values.

    An effect appears once for each assignment of available channels to its roles, such as a delay
    of either of two sensors. `instead` gives channels their replacement here, such as a commanded
    current for the measured one. Effects of standstill are candidates where `at_rest` samples
    count.
    """
    played, known, terms = instead or {}, CHANNELS[equation], []
    for effect in catalogue().values():
        if equation not in effect.balances or (effect.at_rest and not at_rest):
            continue
        for way in product(*(known.get(role, ()) for role in effect.roles)):
            channels = zip(effect.roles, (played.get(c, c) for c in way), strict=True)
            terms.append(Term(effect, effect.balances[equation], dict(channels)))
    there = set(available)
    return [t for t in terms if set(measured_channels(t.channels.values())) <= there]
