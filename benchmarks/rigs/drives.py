"""Recipes of ripples, springs, transmission and torque constant: catalogue names, drawn forms."""

from functools import partial

import numpy as np

from benchmarks.rigs.drawn import Drawn, Ranges, Recipe, order_over
from benchmarks.rigs.frictions import LOOPS, WORDS
from benchmarks.rigs.hidden import Hidden, Table
from benchmarks.rigs.plant import over
from estimation.recording import FloatArray
from rig.simulation.forms import Random, bank, bend, grid, power, rising

TURN = 2.0 * np.pi
BANK_OF_LAGS = 3


def wave(random: Random, order: int, sidebands: bool) -> FloatArray:
    """Return a wave over one turn: an order, some harmonics, and sidebands once a turn."""
    turn = 2.0 * np.pi * np.linspace(0.0, 1.0, 2048)
    total = np.sin(order * turn + random.uniform(0.0, 2.0 * np.pi))
    for harmonic in (2, 3):
        if random.random() < 0.5:
            share = random.uniform(0.1, 0.4) / (harmonic - 1)
            total += share * np.sin(harmonic * order * turn + random.uniform(0.0, 2.0 * np.pi))
    if sidebands and order > 1:
        depth = random.uniform(0.1, 0.5)
        total *= 1.0 + depth * np.sin(turn + random.uniform(0.0, 2.0 * np.pi))
    return np.asarray(total)


def knee(random: Random, x: FloatArray) -> FloatArray:
    """Return an odd form of slope 1 at 0 that levels off at about 1, of a random kind."""
    power = random.uniform(1.0, 4.0)
    kinds = (
        np.tanh(x),
        x / (1.0 + np.abs(x) ** power) ** (1.0 / power),
        2.0 / np.pi * np.arctan(0.5 * np.pi * x),
        np.clip(x, -1.0, 1.0),
    )
    return np.asarray(kinds[int(random.integers(len(kinds)))])


def turn_table(random: Random, ranges: Ranges, shaft: str, most: int) -> Table:
    """Draw a wave over the turn of `motor` or `spindle`."""
    order = order_over(random, ranges, shaft, most)
    form = wave(random, order, sidebands=shaft == "motor" and random.random() < 0.6)
    return Table(f"{shaft}_angle", 0.0, TURN, form, periodic=True)


def motor_ripple(random: Random, ranges: Ranges) -> Drawn:
    """Draw cogging."""
    part = Hidden("motor", "table", (turn_table(random, ranges, "motor", 12),))
    return Drawn(WORDS["motor"], "ripple.motor", ("motor_angle",), part, ranges.level("motor"))


def current_ripple(random: Random, ranges: Ranges) -> Drawn:
    """Draw a torque constant that ripples with the motor's turn."""
    part = Hidden("constant", "table", (turn_table(random, ranges, "motor", 12),))
    return Drawn(WORDS["motor"], "ripple.current", ("motor_angle", "current"), part, 0.1)


def output_ripple(place: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw a torque that repeats with the spindle's turn."""
    part = Hidden(place, "table", (turn_table(random, ranges, "spindle", 60),))
    return Drawn(WORDS[place], "ripple.output", ("spindle_angle",), part, ranges.level(place))


def eccentric(random: Random, ranges: Ranges) -> Drawn:
    """Draw a lever arm of the gear that varies with the spindle's angle."""
    wheel = turn_table(random, ranges, "spindle", 16)
    load = ranges.sided("gear_torque", power(random, 0.9, 1.1), odd=True)
    part = Hidden("motor", "table", (wheel, load))
    return Drawn(
        WORDS["motor"], "eccentric.load", ("spindle_angle", "load"), part, ranges.level("motor")
    )


def pulley(random: Random, ranges: Ranges) -> Drawn:
    """Draw a pulley that is not round: it moves the cable and changes its own lever."""
    part = Hidden("pulley", "table", (turn_table(random, ranges, "spindle", 16),))
    others = ("coupling.kinematic", "ripple.output")
    return Drawn("pulley", "eccentric.load", ("spindle_angle", "load"), part, 0.01, others)


def spring(place: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw a spring between a part and the ground, hardening or softening."""
    variable = "jaw_angle" if place == "jaw" else "spindle_angle"
    part = Hidden(place, "table", (ranges.table(variable, rising(random) - 0.5),))
    word = WORDS.get(place, "jaw")
    return Drawn(word, "spring.position", (variable,), part, ranges.level(place))


def end_stop(random: Random, ranges: Ranges) -> Drawn:
    """Draw a stop that is met near one end of the jaw's travel."""
    x = np.clip(grid() - random.uniform(0.6, 0.8), 0.0, None)
    form = (x / x.max()) ** random.uniform(1.0, 2.2)
    part = Hidden("jaw", "table", (ranges.table("jaw_angle", form),))
    return Drawn("jaw", "spring.end_stop", ("jaw_angle",), part, ranges.level("jaw"))


def payload(random: Random, ranges: Ranges) -> Drawn:
    """Draw a weight on the jaw whose arm is not quite that of a point."""
    x = np.linspace(-np.pi, np.pi, 513)
    form = np.sin(x + random.uniform(0.0, TURN)) * np.interp(
        x, np.linspace(-4, 4, 129), bend(random)
    )
    table = Table("jaw_angle", -np.pi, np.pi, form)
    part = Hidden("jaw", "table", (table,))
    return Drawn("jaw", "gravity.payload", ("jaw_angle",), part, 2.0 * ranges.level("jaw"))


def saturation(random: Random, ranges: Ranges) -> Drawn:
    """Draw a torque constant that falls with the size of the current."""
    table = ranges.sided("current", power(random, 1.0, 2.5), odd=False)
    part = Hidden("constant", "table", (table,))
    return Drawn(WORDS["motor"], "motor.saturation", ("current",), part, 0.1)


def thermal(random: Random, ranges: Ranges) -> Drawn:
    """Draw a torque constant that falls as the winding warms."""
    part = Hidden(
        "constant", "table", (ranges.table("heat", rising(random)),), heat_s=over(random, 1.5, 10.0)
    )
    return Drawn(WORDS["motor"], "motor.thermal", ("current", "time"), part, 0.1)


def backlash(random: Random, ranges: Ranges) -> Drawn:
    """Draw lost motion of the gear with edges that are more or less soft."""
    x = np.linspace(-8.0, 8.0, 1025)
    table = Table("twist", -8.0, 8.0, knee(random, x))
    part = Hidden("gear", "table", (table,), similar=True)
    return Drawn("gear", "transmission.backlash", ("load",), part, 0.05 * ranges.size("twist"))


def stiffening(place: str, variable: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw a spring that is not straight."""
    sign = 1.0 if random.random() < 0.5 else -1.0
    table = ranges.sided(variable, power(random, 1.6, 3.0), odd=True)
    made = Table(variable, table.low, table.high, sign * table.values)
    part = Hidden(place, "table", (made,))
    guess = 0.1 * ranges.size(variable)
    return Drawn(place, "transmission.stiffening", ("load",), part, guess)


def relaxation(place: str, variable: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw a part of the deflection that comes with time, over several times."""
    count = int(random.integers(1, BANK_OF_LAGS + 1))
    times = np.sort([over(random, 0.08, 3.0) for _ in range(count)])
    weights = random.dirichlet(np.ones(count))
    part = Hidden(place, "lags", (ranges.table(variable),), reach=times, weights=weights)
    return Drawn(place, "transmission.relaxation", ("load", "time"), part, 0.15)


def inner_loop(place: str, variable: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw wires or teeth that rub on each other while a spring deflects."""
    reach = ranges.span(variable) * over(random, 0.04, 0.25)
    kind, reaches, weights = bank(random, reach)
    part = Hidden(place, kind, (ranges.table(variable),), reach=reaches, weights=-weights)
    if kind == "bouc_wen":
        part = Hidden(place, kind, (ranges.table(variable),), reach=reaches, weights=weights)
    guess = 0.03 * ranges.size(variable)
    return Drawn(place, LOOPS[kind == "bouc_wen"], ("load", "history"), part, guess, LOOPS)


def play(random: Random, ranges: Ranges) -> Drawn:
    """Draw play of the cable that is taken up after each reversal of the spindle."""
    count = int(random.integers(1, 4))
    reach = ranges.span("spindle_angle") * over(random, 0.01, 0.06)
    reaches = reach * np.exp(random.uniform(-0.5, 0.5, count))
    weights = random.dirichlet(3.0 * np.ones(count))
    table = ranges.table("spindle_angle")
    part = Hidden("cable", "stops", (table,), reach=reaches, weights=weights)
    guess = 0.03 * ranges.size("stretch")
    return Drawn(
        "cable", "transmission.backlash", ("spindle_angle", "history"), part, guess, LOOPS,
    )  # fmt: skip


def wavy(random: Random, ranges: Ranges) -> Drawn:
    """Draw a wave of the gear's position along the spindle's turn."""
    part = Hidden("gear", "table", (turn_table(random, ranges, "spindle", 40),))
    guess = 0.03 * ranges.size("twist")
    return Drawn("gear", "ripple.output", ("spindle_angle",), part, guess)


DRIVES: dict[str, Recipe] = {
    "ripple.motor motor": motor_ripple,
    "ripple.current motor": current_ripple,
    "ripple.output motor": partial(output_ripple, "motor"),
    "ripple.output spindle": partial(output_ripple, "spindle"),
    "eccentric.load motor": eccentric,
    "eccentric.load pulley": pulley,
    "spring.position motor": partial(spring, "motor"),
    "spring.position spindle": partial(spring, "spindle"),
    "spring.position jaw": partial(spring, "jaw"),
    "spring.end_stop jaw": end_stop,
    "gravity.payload jaw": payload,
    "motor.saturation motor": saturation,
    "motor.thermal motor": thermal,
    "transmission.backlash gear": backlash,
    "transmission.stiffening gear": partial(stiffening, "gear", "twist"),
    "transmission.stiffening cable": partial(stiffening, "cable", "stretch"),
    "transmission.relaxation gear": partial(relaxation, "gear", "twist"),
    "transmission.relaxation cable": partial(relaxation, "cable", "stretch"),
    "hysteresis.presliding gear": partial(inner_loop, "gear", "twist"),
    "hysteresis.presliding cable": partial(inner_loop, "cable", "stretch"),
    "transmission.backlash cable": play,
    "ripple.output gear": wavy,
}
