"""The channel of each role of an effect in each equation.

Each quantity comes from its least noisy sensor: speed comes from the motor's encoder. After the
gearbox, for cable and stretch, it comes from the spindle's encoder: gear wind-up turns the motor
and not the spindle (on measured data the motor's speed doubles the cable's error), and the jaw's
coarse encoder causes an apparent delay. A load is never the target of the same equation: noise
shared by both sides of an equation looks like an effect.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

from estimation.effects.effect import Effect

MOTOR_LOAD, CABLE_LOAD, CABLE_ANGLE = "motor_load_n_m", "cable_load_n_m", "cable_angle_rad"
"""Loads and an angle of the reference rig that nominal constants predict from one sensor. Each
replaces the sensor that is the target, since noise shared by both sides of an equation looks like
an effect."""

JOINTS = range(1, 8)
"""Joints of the arm that may act on one another."""

AXES = ("grasp", "pitch", "yaw")
"""Axes of a wristed grasper in the space of the task."""

MOTORS = ("yaw", "jaw_1", "jaw_2")
"""The same grasper's axes in the space of its motors."""

ANGLES = ("position", "travel", "motor_angle", "output_angle", "encoder", "stop", "tilt")
"""Roles of the angle of an axis with a single encoder."""

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


class Entry(NamedTuple):
    """One way to add an effect to an equation: its side, and the channel of each role."""

    sign: int
    channels: Mapping[str, str]


def _of_joint(joint: int) -> list[Mapping[str, tuple[str, ...]]]:
    """Return the roles in the torque equation of one joint of an arm.

    One mapping for a revolute joint, one for a prismatic joint, and one for each motor of a
    cable-driven wrist that acts on the joint. An effect takes all its motion from one of them.
    """
    own = f"joint_{joint}"
    others = [f"joint_{other}" for other in JOINTS if other != joint]
    shared = {
        "other_reading": _either(others, "torque_n_m", "force_n"),
        "other_torque": _either(others, "torque_n_m", "force_n"),
        "other_angle": _either(others, "angle_rad", "position_m"),
        "clock": ("time_s",),
        "elapsed": ("time_s", "campaign_time_s"),
        "campaign_clock": ("campaign_time_s",),
    }
    turning = ("angle_rad", "velocity_rad_s", "acceleration_rad_s2")
    sliding = ("position_m", "velocity_m_s", "acceleration_m_s2")
    drives = [(f"{own}_drive_{motor}", turning) for motor in JOINTS]
    return [
        {**_moving(*(f"{name}_{unit}" for unit in units)), **shared}
        for name, units in [(own, turning), (own, sliding), *drives]
    ]


def _either(names: Sequence[str], *units: str) -> tuple[str, ...]:
    return tuple(f"{name}_{unit}" for name in names for unit in units)


def _moving(position: str, velocity: str, acceleration: str) -> Mapping[str, tuple[str, ...]]:
    """Return the roles of one motion."""
    return {
        "speed": (velocity,),
        "acceleration": (acceleration,),
        **dict.fromkeys(
            ("position", "travel", "output_angle", "encoder", "stop", "tilt"), (position,)
        ),
        "reading": (velocity, acceleration),
    }


def _of_axis(axis: str) -> Mapping[str, tuple[str, ...]]:
    """Return the roles in the equation of one axis of a wrist, from its own motor's current."""
    others = [other for other in (AXES if axis in AXES else MOTORS) if other != axis]
    current, angle = f"{axis}_current_a", f"{axis}_angle_rad"
    return _MOTION | {
        "speed": (f"{axis}_velocity_rad_s",),
        "acceleration": (f"{axis}_acceleration_rad_s2",),
        **dict.fromkeys(ANGLES, (angle,)),
        "axis_angle": (angle,),
        "axis_current": (current,),
        "axis_speed": (f"{axis}_velocity_rad_s",),
        "axis_acceleration": (f"{axis}_acceleration_rad_s2",),
        "current": (current,),
        "drive": (current,),
        "load": (current,),
        "reading": (current,),
        "other_reading": tuple(f"{other}_current_a" for other in others),
        "other_torque": tuple(f"{other}_torque_n_m" for other in others),
        "other_angle": tuple(f"{other}_angle_rad" for other in others),
    }


def _known(kind: str, number: str) -> list[Mapping[str, tuple[str, ...]]]:
    """Return the roles of an equation, one mapping for each motion that may be in it."""
    if kind == "joint":
        return _of_joint(int(number))
    if kind == "calibration":
        if number in PARTS:
            return [CHANNELS[PARTS[number]]]
        return [_ENCODER if number == "encoder" else _SENSOR]
    if kind not in (*AXES, *MOTORS):
        return [CHANNELS[kind]] if kind in CHANNELS else []
    own = _of_axis(kind)
    if kind not in CHANNELS:
        return [own]
    # the grasp of a single-axis rig, or the one of three axes of a wrist
    rig = CHANNELS[kind]
    both = {**rig, **own}
    return [{role: tuple(dict.fromkeys((*rig.get(role, ()), *own.get(role, ())))) for role in both}]


OF_SENSOR: Mapping[str, int] = {
    "hysteresis.presliding": 1,
    "hysteresis.presliding.maxwell": 1,
    "sensor.creep": 1,
    "sensor.drift": 1,
    "sensor.gain_nonlinear": 1,
    "sensor.crosstalk": 1,
}
"""Candidate effects for the equation of a sensor's calibration, `reference = calibrated`, and their
side. An effect that makes a sensor lag its load adds to the reference while the load rises. Where
the load is known exactly the equation is `read = applied`."""

_CALIBRATED = ("calibrated_n", "applied_n", "applied_n_m")
_SENSOR = {
    "travel": _CALIBRATED,
    "reading": _CALIBRATED,
    "creeping": _CALIBRATED,
    "other_reading": ("second_axis_n", "third_axis_n"),
    "clock": ("time_s",),
    "elapsed": ("time_s",),
}

OF_ENCODER: Mapping[str, int] = {
    "sensor.encoder_inl": 1,
    "sensor.encoder_inl.harmonics": 1,
    "hysteresis.presliding": -1,
    "sensor.delay": 1,
    "sensor.drift": 1,
}
"""Candidate effects for the equation of an encoder's calibration against another one."""

_ENCODER = {
    "encoder": ("reference_angle_rad",),
    "travel": ("reference_angle_rad",),
    "reading": ("reference_angle_rad",),
    "clock": ("time_s",),
    "elapsed": ("time_s",),
}

PARTS = {"current": "motor", "gearbox": "gearbox"}
"""Calibrations of a part of the rig, and the corresponding equation of the rig."""


def _side(effect: Effect, kind: str, number: str) -> int | None:
    """Return the side of an effect in an equation; None if the effect does not apply."""
    if kind == "calibration" and number in PARTS:
        return effect.balances.get(PARTS[number])
    if kind == "calibration":
        return (OF_ENCODER if number == "encoder" else OF_SENSOR).get(effect.id)
    if kind in (*AXES, *MOTORS):  # an axis of the wrist is like the grasp unless stated
        return effect.balances.get(kind, effect.balances.get("grasp"))
    return effect.balances.get(kind)


def entries(effect: Effect, balance: str) -> list[Entry]:
    """Return the ways to add an effect to an equation; empty if it does not apply there.

    Args:
        effect: An effect of the catalogue.
        balance: Id of the equation, such as `motor` or `joint.3`.
    """
    kind, _, number = balance.partition(".")
    sign = _side(effect, kind, number)
    if sign is None:
        return []
    ways = [
        tuple(zip(effect.roles, way, strict=True))
        for known in _known(kind, number)
        for way in product(*(known[role] for role in effect.roles))
    ]
    return [Entry(sign, dict(way)) for way in dict.fromkeys(ways)]
