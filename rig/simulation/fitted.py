"""Parameters of the simulated rig from fitted models and a recording: plant, load, sensors."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy import signal

from estimation.model import Model, Term
from estimation.recording import FloatArray, Recording
from rig.errors import DataError
from rig.simulation.parameters import PlantParameters, SensorParameters

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

NOISE_ABOVE_HZ = 150.0
"""White noise is measured above this frequency, where the rig barely moves."""


def plant_of(models: Iterable[Model], start: PlantParameters = DECLARED_PLANT) -> PlantParameters:
    """Return the plant that corresponds to the fitted models.

    Other parameters keep their values. All losses of the cable's equation are at the spindle.

    Args:
        models: Fitted models of the equations `motor`, `gearbox`, `cable` and `stretch`; any of
            them may be missing, others are ignored.
        start: Plant with the values of all other parameters.

    Raises:
        NotFittedError: A parameter has no value.
        DataError: A value makes no plant, such as a negative stiffness.
    """
    by_balance = {model.balance: model for model in models}
    plant = replace(start, gear_ratio=_gear_ratio(by_balance.values(), start.gear_ratio))
    for balance, change in (
        ("motor", _with_motor),
        ("gearbox", _with_gearbox),
        ("stretch", _with_stretch),
        ("cable", _with_cable),
    ):
        if balance in by_balance:
            plant = change(by_balance[balance], plant)
    return plant


def _gear_ratio(models: Iterable[Model], usual: float) -> float:
    """Return the ratio of the gearbox of the models' machine; the usual one if none has it."""
    for model in models:
        bend = model.signals.combination("gearbox_differential_rad")
        if bend is not None and (gain := bend.gain("motor_angle_rad")) > 0.0:
            return 1.0 / gain
    return usual


def _with_motor(model: Model, plant: PlantParameters) -> PlantParameters:
    """Read proximal torque = K i - J a - b w - F sgn w, per motor speed, torque at the spindle.

    The sensor carries the drive unit, so the rotor's inertia acts on it ratio - 1 times.
    """
    ratio = plant.gear_ratio
    return replace(
        plant,
        torque_constant_n_m_a=_positive(model, "motor.torque_constant", "gain") / ratio,
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
    stiffness = 1.0 / slope if model.unit == "rad" else slope
    return replace(plant, gear_stiffness_n_m_rad=stiffness)


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
    ratio, changed = plant.cable_ratio, plant
    viscous = _term(model, "friction.viscous")
    if viscous is not None:
        damping = viscous.values["damping"].value * _per_spindle(viscous, "speed", changed)
        changed = replace(changed, spindle_viscous_n_m_s_rad=damping)
    inertia = _term(model, "inertia.missing")
    if inertia is not None:
        total = inertia.values["inertia"].value * _per_spindle(inertia, "acceleration", changed)
        others = (
            plant.gear_ratio * plant.rotor_inertia_kg_m2 + ratio * ratio * plant.jaw_inertia_kg_m2
        )
        own = max(total - others, 0.25 * plant.spindle_inertia_kg_m2)
        changed = replace(changed, spindle_inertia_kg_m2=own)
    friction = _amplitude(model, "friction.coulomb", "friction", plant.spindle_friction_n_m)
    width = _width(model, changed.spindle_creep_speed_rad_s, changed)
    return replace(changed, spindle_friction_n_m=friction, spindle_creep_speed_rad_s=width)


def _term(model: Model, effect: str) -> Term | None:
    return next((term for term in model.terms if term.effect.id == effect), None)


def _amplitude(model: Model, effect: str, name: str, missing: float) -> float:
    term = _term(model, effect)
    if term is None:
        return missing
    place = [p.name for p in term.effect.amplitudes].index(name)
    return term.numbers(term.effect.amplitudes)[place]


def _positive(model: Model, effect: str, name: str) -> float:
    value = _amplitude(model, effect, name, float("nan"))
    if not value > 0.0:
        raise DataError(
            f"The {model.balance} model {model.name!r} makes no plant: {effect} {name} is {value}.",
            "The simulated null needs a positive value.",
            "Fit the declared model on these runs first.",
        )
    return value


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
                f"The {model.balance} model {model.name!r} makes no plant: "
                f"its slope over {names[0]} is {slope:g}.",
                "A spring of no or negative stiffness cannot be simulated.",
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


def with_load_unit(plant: PlantParameters, runs: Sequence[Recording]) -> PlantParameters:
    """Return the plant with the load unit the runs show: torque a load current, and friction.

    Least squares of distal torque on the load's current and the smooth direction of the spindle,
    each run with its own offset only where the load varies in it.
    """
    tables = [
        np.column_stack(
            [
                run["load_command_a"],
                _direction(run),
                np.ones(len(run)),
                run["distal_torque_n_m"],
            ]
        )[::20]
        for run in runs
    ]
    table = np.concatenate(tables)
    if np.ptp(table[:, 0]) == 0.0:
        return plant
    slope, friction, _ = np.linalg.lstsq(table[:, :3], table[:, 3], rcond=None)[0]
    if slope <= 0.0:
        return plant
    return replace(
        plant, load_torque_n_m_a=float(slope), load_friction_n_m=max(float(friction), 0.0)
    )


def _direction(run: Recording) -> FloatArray:
    speed = np.gradient(run["spindle_angle_rad"], run.time_s)
    smooth = signal.sosfiltfilt(signal.butter(2, 20.0, fs=run.sample_rate_hz, output="sos"), speed)
    direction: FloatArray = np.tanh(smooth / 0.02)
    return direction


def quantum(values: FloatArray) -> float | None:
    """Return the resolution of a converter, or None with fewer than two different values."""
    gaps = np.diff(np.unique(values))
    gaps = gaps[gaps > 1e-9]
    return float(gaps.min()) if gaps.size else None


def noise_std(values: FloatArray, rate_hz: float) -> float:
    """Return the standard deviation of white noise that has the power above `NOISE_ABOVE_HZ`."""
    sos = signal.butter(6, NOISE_ABOVE_HZ, "highpass", fs=rate_hz, output="sos")
    high = signal.sosfiltfilt(sos, values)
    edge = min(100, values.size // 4)
    share = 1.0 - NOISE_ABOVE_HZ / (0.5 * rate_hz)
    return float(np.std(high[edge : values.size - edge]) / np.sqrt(share))


def sensors_of(
    runs: Sequence[Recording], silent: Mapping[str, float], start: SensorParameters
) -> SensorParameters:
    """Return sensors with the quanta and the noise of the recordings.

    Args:
        runs: Measured runs.
        silent: Channel to the noise of a simulation without sensor noise, from quantisation and
            the controller; it is subtracted from the recordings' noise to get that of the sensor.
        start: Sensors whose other values are kept.
    """

    def own(channel: str) -> float:
        found = float(np.median([noise_std(r[channel], r.sample_rate_hz) for r in runs]))
        return float(np.sqrt(max(found**2 - silent[channel] ** 2, 0.0)))

    return replace(
        start,
        proximal_noise_n_m=own("proximal_torque_n_m"),
        distal_noise_n_m=own("distal_torque_n_m"),
        current_noise_a=own("motor_current_a"),
    )


def with_quanta(sensors: SensorParameters, run: Recording) -> SensorParameters:
    """Return silent sensors, drift and offset free, that round as the recording's do."""
    torque = quantum(run["proximal_torque_n_m"]) or sensors.torque_n_m_per_count
    current = quantum(run["motor_current_a"]) or sensors.current_a_per_count
    counts = {
        f"{name}_count_per_turn": round(2.0 * np.pi / step)
        for name in ("motor", "spindle", "jaw")
        if (step := quantum(run[f"{name}_angle_rad"])) is not None
    }
    return replace(
        sensors,
        **counts,
        torque_n_m_per_count=torque,
        torque_quantum_count=1.0,
        torque_limit_count=sensors.torque_limit_count * sensors.torque_n_m_per_count / torque,
        current_a_per_count=current,
        proximal_noise_n_m=0.0,
        distal_noise_n_m=0.0,
        current_noise_a=0.0,
        proximal_offset_n_m=0.0,
        distal_offset_n_m=0.0,
        proximal_ramp_n_m_s=0.0,
        distal_ramp_n_m_s=0.0,
        torque_walk_n_m_s=0.0,
    )
