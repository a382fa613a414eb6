"""Recipes of sensor faults: catalogue names, forms drawn again each time."""

from functools import partial

import numpy as np

from benchmarks.rigs.drawn import Drawn, Ranges, Recipe, order_over
from benchmarks.rigs.drives import wave
from benchmarks.rigs.hidden import Table
from benchmarks.rigs.plant import over
from benchmarks.rigs.sensors import Fault
from rig.simulation.forms import POINTS, Random, course, grid, power

TURN = 2.0 * np.pi
PLACES = {
    "motor_current_a": ("current sensor", "current", "current"),
    "proximal_torque_n_m": ("proximal sensor", "gear_torque", "load"),
    "distal_torque_n_m": ("distal sensor", "cable_torque", "load"),
    "motor_angle_rad": ("motor encoder", "motor_angle", "motor_angle"),
    "spindle_angle_rad": ("spindle encoder", "spindle_angle", "spindle_angle"),
    "jaw_angle_rad": ("jaw encoder", "jaw_angle", "jaw_angle"),
}
"""Channel to the sensor in words, its variable here, and the same as a diagnosis calls it."""

LATE = ("sensor.delay", "sensor.lag")


def gain(channel: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw a gain that changes over the range."""
    word, variable, known = PLACES[channel]
    odd = bool(random.random() < 0.6)
    table = ranges.sided(variable, power(random, 1.6, 3.2), odd)
    fault = Fault(channel, "function", channel, table)
    return Drawn(word, "sensor.gain_nonlinear", (known,), fault, 0.03 * ranges.size(variable))


def drift(channel: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw a zero that drifts in each run, or over the campaign."""
    word, variable, _ = PLACES[channel]
    within = bool(random.random() < 0.6)
    length = ranges.duration_s if within else ranges.span_s
    table = Table("time", 0.0, length, course(random, grid()))
    fault = Fault(channel, "function", "run_time" if within else "campaign_time", table)
    return Drawn(word, "sensor.drift", ("time",), fault, 0.03 * ranges.size(variable))


def knocked(channel: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw a zero that steps at one moment of each run."""
    word, variable, _ = PLACES[channel]
    sharp = random.uniform(0.002, 0.015)
    form = 0.5 + 0.5 * np.tanh((grid() - random.uniform(0.25, 0.75)) / sharp)
    table = Table("time", 0.0, ranges.duration_s, form)
    fault = Fault(channel, "function", "run_time", table)
    return Drawn(word, "change.step", ("time",), fault, 0.03 * ranges.size(variable))


def crosstalk(channel: str, source: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw a reading that another quantity leaks into, nearly in proportion."""
    word, variable, _ = PLACES[channel]
    _, other, known = PLACES[source]
    form = power(random, 0.8, 1.25)
    table = ranges.sided(other, form, odd=True)
    if source == "jaw_angle_rad":  # an angle's zero is anywhere: over its range, not its sign
        table = ranges.table(other, np.linspace(-1.0, 1.0, POINTS))
    fault = Fault(channel, "function", source, table)
    return Drawn(word, "sensor.crosstalk", (known,), fault, 0.03 * ranges.size(variable))


def late(channel: str, kind: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw a reading that comes late: a delay or a lag."""
    word, _, known = PLACES[channel]
    return Drawn(word, f"sensor.{kind}", (known, "time"), Fault(channel, kind), 3e-3, LATE)


def creep(channel: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw a share of the reading that comes slowly, over one to three times."""
    word, _, known = PLACES[channel]
    count = int(random.integers(1, 4))
    times = np.sort([over(random, 0.3, 5.0) for _ in range(count)])
    fault = Fault(channel, "creep", times_s=times, weights=random.dirichlet(2.0 * np.ones(count)))
    return Drawn(word, "sensor.creep", (known, "time"), fault, 0.05)


def nonlinear(channel: str, most: int, random: Random, ranges: Ranges) -> Drawn:
    """Draw an encoder's error along its own turn."""
    word, variable, known = PLACES[channel]
    shaft = variable.removesuffix("_angle")
    order = order_over(random, ranges, shaft, most)
    form = wave(random, order, sidebands=False)
    fault = Fault(channel, "function", channel, Table(variable, 0.0, TURN, form, periodic=True))
    return Drawn(word, "sensor.encoder_inl", (known,), fault, 5e-3)


BROKEN: dict[str, Recipe] = {
    "sensor.gain_nonlinear current": partial(gain, "motor_current_a"),
    "sensor.gain_nonlinear proximal": partial(gain, "proximal_torque_n_m"),
    "sensor.gain_nonlinear distal": partial(gain, "distal_torque_n_m"),
    "sensor.delay current": partial(late, "motor_current_a", "delay"),
    "sensor.delay proximal": partial(late, "proximal_torque_n_m", "delay"),
    "sensor.lag proximal": partial(late, "proximal_torque_n_m", "lag"),
    "sensor.delay distal": partial(late, "distal_torque_n_m", "delay"),
    "sensor.lag distal": partial(late, "distal_torque_n_m", "lag"),
    "sensor.delay jaw_encoder": partial(late, "jaw_angle_rad", "delay"),
    "sensor.delay spindle_encoder": partial(late, "spindle_angle_rad", "delay"),
    "sensor.drift proximal": partial(drift, "proximal_torque_n_m"),
    "sensor.drift distal": partial(drift, "distal_torque_n_m"),
    "change.step proximal": partial(knocked, "proximal_torque_n_m"),
    "change.step distal": partial(knocked, "distal_torque_n_m"),
    "sensor.creep proximal": partial(creep, "proximal_torque_n_m"),
    "sensor.creep distal": partial(creep, "distal_torque_n_m"),
    "sensor.crosstalk proximal": partial(crosstalk, "proximal_torque_n_m", "jaw_angle_rad"),
    "sensor.crosstalk distal": partial(crosstalk, "distal_torque_n_m", "motor_current_a"),
    "sensor.encoder_inl motor_encoder": partial(nonlinear, "motor_angle_rad", 4),
    "sensor.encoder_inl spindle_encoder": partial(nonlinear, "spindle_angle_rad", 40),
    "sensor.encoder_inl jaw_encoder": partial(nonlinear, "jaw_angle_rad", 40),
}
