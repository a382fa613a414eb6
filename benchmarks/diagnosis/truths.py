"""What each hidden effect is called, what may be said instead, and in which equation it shows.

A name is right when it is the family or an accepted equivalent: one that the rig's sensors
cannot distinguish from it in that equation, whatever is played.
"""

from dataclasses import dataclass

ANGLE = frozenset({"spindle_angle", "jaw_angle", "motor_angle"})
DIRECTION = frozenset({"velocity_sign", "velocity"})
SPEED = frozenset({"velocity"})
MEMORY = frozenset({"history", "velocity"})
LOAD = frozenset({"load", "current"})
WRIST = frozenset({"wrist_pitch"})
"""Words of a diagnosis that mean the same on one rig: its angles move together, and so on."""


def same_on_one_rig(variable: str) -> frozenset[str]:
    """Return the words that name a variable as well as its own does."""
    groups = (ANGLE, SPEED, DIRECTION, MEMORY, LOAD, WRIST)
    return next((g for g in groups if variable in g), frozenset({variable}))


@dataclass(frozen=True)
class Truth:
    """The answer to one hidden effect.

    Attributes:
        family: Catalogue id, or `unknown` for what no catalogue holds.
        equations: Equations in which it shows.
        accepted: Families that cannot be distinguished from it.
        depends_on: For `unknown`: one word of each group, and no other, is right.
        scale: Strength of a strong case; 1 unless the effect is faint or loud on this rig.
        needs: Excitation that shows it, one of `EXCITATIONS`.
        course: How it changes from run to run: empty for alike in all, `comes` with one run and
            stays, or `fades`.
    """

    family: str
    equations: frozenset[str]
    accepted: frozenset[str] = frozenset()
    depends_on: tuple[frozenset[str], ...] = ()
    scale: float = 1.0
    needs: str = "usual"
    course: str = ""


def _of(
    family: str,
    equations: str,
    accepted: str = "",
    scale: float = 1.0,
    needs: str = "usual",
    course: str = "",
) -> Truth:
    where, equal = frozenset(equations.split()), frozenset(accepted.split())
    return Truth(family, where, equal, (), scale, needs, course)


def _outside(equations: str, *groups: frozenset[str], needs: str = "usual") -> Truth:
    return Truth("unknown", frozenset(equations.split()), frozenset(), groups, needs=needs)


CATALOGUED: dict[str, Truth] = {
    # motor and gear losses
    "motor_asymmetry": _of("friction.coulomb_asymmetry", "motor", "", 4.0),
    "motor_drag": _of("friction.drag", "motor"),
    "gear_stribeck": _of("friction.stribeck", "motor"),
    "gear_load_friction": _of("friction.load", "motor"),
    "cable_growing_friction": _of("friction.position", "cable"),
    # memory: both are elastic-plastic elements, of different order and place
    "cable_presliding": _of("hysteresis.presliding", "cable", "hysteresis.bouc_wen"),
    "cable_hysteresis": _of("hysteresis.bouc_wen", "stretch", "hysteresis.presliding", 1.5),
    "cable_creep": _of("transmission.relaxation", "stretch"),
    # springs act between jaw and ground, where no torque sensor is
    "jaw_spring": _of("spring.position", "cable stretch", "gravity.payload"),
    "end_stop_spring": _of("spring.end_stop", "cable stretch"),
    # waves; in the gearbox's equation a bent gear and a bent encoder are the same
    "motor_ripple": _of("ripple.motor", "motor"),
    "current_ripple": _of("ripple.current", "motor", "", 0.6),
    "spindle_ripple": _of("ripple.output", "cable"),
    "gear_eccentricity": _of("ripple.output", "gearbox", "sensor.encoder_inl"),
    "eccentric_pulley": _of("eccentric.load", "cable stretch", "coupling.kinematic ripple.output"),
    "jaw_encoder_wave": _of("sensor.encoder_inl", "stretch", "ripple.output coupling.kinematic"),
    # torque and current: in the motor's equation a falling constant is a rising gain
    "torque_constant_sag": _of("motor.saturation", "motor", "sensor.gain_nonlinear", 2.0),
    "current_sensor_bend": _of("sensor.gain_nonlinear", "motor", "motor.saturation", 2.5),
    "winding_heat": _of("motor.thermal", "motor"),
    "torque_lag": _of("motor.electrical", "motor", "sensor.delay sensor.lag"),
    # gear
    "gear_backlash": _of("transmission.backlash", "gearbox"),
    "gear_stiffening": _of("transmission.stiffening", "gearbox", "", 1.5),
    # sensors
    "proximal_bend": _of("sensor.gain_nonlinear", "motor gearbox cable", "transmission.stiffening"),
    "proximal_creep": _of("sensor.creep", "motor gearbox cable", "transmission.relaxation"),
    "proximal_lag": _of("sensor.lag", "motor gearbox cable", "sensor.delay"),
    "distal_drift": _of("sensor.drift", "cable stretch", "sensor.creep"),
    "distal_crosstalk": _of("sensor.crosstalk", "cable stretch"),
    "jaw_delay": _of("sensor.delay", "stretch", "sensor.lag"),
    "friction_step": _of("change.step", "cable", "friction.coulomb"),
    "jaw_mass": _of("inertia.missing", "stretch cable"),
    # losses that take speed, load, rest, age or another axis to show
    "motor_viscous_asymmetry": _of("friction.viscous_asymmetry", "motor"),
    "gear_load_viscous": _of("friction.load_viscous", "motor"),
    "grease_warmup": _of("friction.warmup", "motor"),
    "gear_wear": _of("change.step", "motor", "friction.coulomb", course="comes"),
    "cable_stiff": _of("friction.warmup", "cable", course="fades"),
    "cable_dwell": _of("friction.dwell", "cable", needs="rests"),
    # over one angle of wrap it is proportional to the load, but for what the ratio takes up
    "cable_capstan": _of("friction.load", "cable", "friction.capstan"),
    "wrist_capstan": _of("friction.capstan", "cable", needs="wrist"),
    "wrist_pull": _of("coupling.kinematic", "stretch", needs="wrist"),
    "jaw_weight": _of("gravity.payload", "cable stretch"),
}

OUTSIDE: dict[str, Truth] = {
    "cable_position_friction": _outside("cable", DIRECTION, ANGLE),
    "cable_load_notch": _outside("cable", DIRECTION, ANGLE, LOAD),
    "gear_two_state": _outside("motor", DIRECTION, MEMORY),
    "gear_angle_viscous": _outside("motor", SPEED, ANGLE),
    "jaw_detent": _outside("cable stretch", ANGLE),
    "wrist_pinch": _outside("cable", DIRECTION, WRIST, needs="wrist"),
}

TRUTHS = CATALOGUED | OUTSIDE

NOT_HIDDEN = {
    "friction.coulomb": "declared",
    "friction.viscous": "declared",
    "compliance.link": "declared",
    "motor.torque_constant": "declared",
    "sensor.offset": "declared",
    "transmission.ratio": "declared",
    "transmission.damping": "declared",
    **dict.fromkeys(("arm.links", "arm.links.change", "arm.friction"), "an arm's"),
    **dict.fromkeys(
        ("motor.dead_zone", "motor.gain_by_position", "motor.gain_by_side"),
        "the simulated drive has one gain, at any current and place",
    ),
    "sensor.gain": "needs a sensor that one equation alone reads, and acts in some of the runs",
    "inertia.position": "needs a linkage, and the rig's shafts are round",
    "coupling.torque": "needs another axis with a torque of its own",
    "unknown": "the answer to what no catalogue holds",
    "friction.condition": "friction.load: the rig's conditions are its loads",
    **dict.fromkeys(
        ("inertia.condition", "motor.condition"),
        "the rig's conditions are its loads, which have neither a mass nor a supply",
    ),
    "sensor.hysteresis": "the simulated torque sensors have no loop",
    "sensor.gain_by_position": "the simulated torque sensors are in line with their shafts",
    "ripple.sensor": "the simulated torque sensors are in line with their shafts",
    "sensor.thermal": "the rig measures no temperature",
    "transmission.thermal": "the rig measures no temperature, and its compliances stay constant",
    "transmission.compliance_by_position": "the simulated cables and gears have one compliance",
    "transmission.scale_error": "the simulated ratios and scales of encoders are the declared ones",
}
"""Families that no case hides, and why the simulated rig cannot."""
