"""Parameters of the simulated plant from fitted models."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from estimation.model import Model, Term
from rig.errors import DataError
from rig.simulation.parameters import PlantParameters

DECLARED_PLANT = PlantParameters(
    cable_load_friction_ratio=0.0,
    spindle_friction_n_m=0.04,
    jaw_friction_n_m=0.0,
    jaw_viscous_n_m_s_rad=0.0,
    motor_creep_speed_rad_s=2.0,
    spindle_creep_speed_rad_s=0.15,
)
"""A rig that the declared equations describe completely.

The default plant, as measured, has three effects that they lack: cable friction in proportion to
the load; losses of the jaw in front of the sensor, which load the cable's stretch and not the
torque sensor at the jaw; and friction that sticks, which at a reversal holds any torque until the
gear is wound up. Here all of it is plain friction of the spindle that changes sign smoothly.
"""


def plant_of(models: Iterable[Model]) -> PlantParameters:
    """Return the plant that corresponds to the fitted models; the rest is `DECLARED_PLANT`'s.

    All losses of the cable's equation are at the spindle. Of the equations `motor`, `gearbox`,
    `cable` and `stretch` any may be missing; others are ignored.

    Raises:
        NotFittedError: A parameter has no value.
        DataError: A value makes no plant, such as a negative stiffness.
    """
    by_balance = {model.balance: model for model in models}
    plant = replace(DECLARED_PLANT, gear_ratio=_gear_ratio(by_balance.values()))
    for balance, change in _READ.items():
        if balance in by_balance:
            plant = change(by_balance[balance], plant)
    return plant


def _gear_ratio(models: Iterable[Model]) -> float:
    """Return the ratio of the gearbox of the models' machine; the usual one if none has it."""
    for model in models:
        bend = model.signals.combination("gearbox_differential_rad")
        if bend is not None and (gain := bend.gain("motor_angle_rad")) > 0.0:
            return 1.0 / gain
    return DECLARED_PLANT.gear_ratio


def _with_motor(model: Model, plant: PlantParameters) -> PlantParameters:
    """Read proximal torque = K i - J a - b w - F sgn w, per motor speed, torque at the spindle.

    The sensor carries the drive unit, so the rotor's inertia acts on it ratio - 1 times.
    """
    ratio, gain = plant.gear_ratio, _amplitude(model, "motor.torque_constant", "gain", math.nan)
    if not gain > 0.0:
        raise DataError(f"The model {model.name!r} makes no plant: its torque constant is {gain}.")
    return replace(
        plant,
        torque_constant_n_m_a=gain / ratio,
        rotor_inertia_kg_m2=max(
            _amplitude(model, "inertia.missing", "inertia", 0.0) / (ratio - 1.0),
            0.2 * plant.rotor_inertia_kg_m2,
        ),
        motor_viscous_n_m_s_rad=_amplitude(model, "friction.viscous", "damping", 0.0) / ratio,
        motor_friction_n_m=_amplitude(model, "friction.coulomb", "friction", 0.0) / ratio,
        motor_creep_speed_rad_s=_width(model, plant.motor_creep_speed_rad_s / ratio, plant) * ratio,
    )


def _with_gearbox(model: Model, plant: PlantParameters) -> PlantParameters:
    """Read twist = torque / stiffness, or torque = stiffness x twist."""
    slope = _slope(model, ("proximal_torque", "gearbox_differential"))
    if slope is None:
        return plant
    return replace(plant, gear_stiffness_n_m_rad=1.0 / slope if model.unit == "rad" else slope)


def _with_stretch(model: Model, plant: PlantParameters) -> PlantParameters:
    """Read ratio x spindle angle - jaw angle = torque / stiffness; the ratio may be geometry.

    The stretch or the jaw's angle may be the target: torque adds to the one, takes from the other.
    """
    ratio = _slope(model, ("spindle_angle",))
    if ratio is not None:
        plant = replace(plant, cable_ratio=ratio)
    slope = _slope(model, ("torque", "load"), -1 if model.target == "jaw_angle_rad" else 1)
    if slope is None:
        return plant
    return replace(plant, cable_stiffness_n_m_rad=1.0 / slope)


def _with_cable(model: Model, plant: PlantParameters) -> PlantParameters:
    """Read proximal torque = ratio x distal torque + viscous + Coulomb + inertia.

    Its ratio of torques is ignored: a plant has one ratio, that of the angles, and a loss that
    makes the torques' differ is not part of the declared model.
    """
    own = {
        "spindle_friction_n_m": _amplitude(
            model, "friction.coulomb", "friction", plant.spindle_friction_n_m
        ),
        "spindle_creep_speed_rad_s": _width(model, plant.spindle_creep_speed_rad_s, plant),
    }
    viscous = _term(model, "friction.viscous")
    if viscous is not None:
        damping = viscous.values["damping"].value * _per_spindle(viscous, "speed", plant)
        own["spindle_viscous_n_m_s_rad"] = damping
    inertia = _term(model, "inertia.missing")
    if inertia is not None:
        total = inertia.values["inertia"].value * _per_spindle(inertia, "acceleration", plant)
        jaw = plant.cable_ratio * plant.cable_ratio * plant.jaw_inertia_kg_m2
        others = plant.gear_ratio * plant.rotor_inertia_kg_m2 + jaw
        own["spindle_inertia_kg_m2"] = max(total - others, 0.25 * plant.spindle_inertia_kg_m2)
    return replace(plant, **own)


def _term(model: Model, effect: str) -> Term | None:
    return next((term for term in model.terms if term.effect.id == effect), None)


def _amplitude(model: Model, effect: str, name: str, missing: float) -> float:
    term = _term(model, effect)
    if term is None:
        return missing
    place = [p.name for p in term.effect.amplitudes].index(name)
    return term.numbers(term.effect.amplitudes)[place]


def _slope(model: Model, words: Sequence[str], side: int = 1) -> float | None:
    """Return the amplitude of the term with one input, one whose name holds one of the words.

    It is positive on its side of the equation.
    """
    for term in model.terms:
        names = list(term.channels.values())
        linear = len(names) == 1 and len(term.effect.amplitudes) == 1 and not term.effect.shape
        if not linear or names[0].endswith("_s") or not any(word in names[0] for word in words):
            continue
        slope = side * term.weights[0]
        if slope <= 0.0:
            raise DataError(
                f"The model {model.name!r} makes no plant: its slope over {names[0]} is {slope:g}."
            )
        return slope
    return None


def _width(model: Model, missing: float, plant: PlantParameters) -> float:
    """Return the speed of the spindle over which the Coulomb friction changes sign."""
    term = _term(model, "friction.coulomb")
    if term is None or "width" not in term.values:
        return missing
    return term.values["width"].value / _per_spindle(term, "speed", plant)


def _per_spindle(term: Term, role: str, plant: PlantParameters) -> float:
    """Return how fast a term's channel moves for one unit at the spindle."""
    channel = term.channels[role]
    if channel.startswith("motor_"):
        return plant.gear_ratio
    return plant.cable_ratio if channel.startswith("jaw_") else 1.0


_READ = {
    "motor": _with_motor,
    "gearbox": _with_gearbox,
    "stretch": _with_stretch,
    "cable": _with_cable,
}
"""Equation to what its model is read by, in this order."""
