"""Recipes of losses at motor and spindle: catalogue names, forms drawn again each time."""

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.rigs.drawn import Drawn, Ranges, Recipe
from benchmarks.rigs.hidden import Hidden, Table
from benchmarks.rigs.plant import over
from rig.simulation.forms import (
    Random,
    bank,
    bend,
    course,
    falling,
    grid,
    power,
    rising,
    smooth,
)

Drawer = Callable[[Random, Ranges], Table]
"""Draws one factor of an effect over its variable's range."""

WORDS = {"motor": "motor shaft", "spindle": "spindle"}
LOADS = {"motor": "gear_torque", "spindle": "cable_torque"}
LOOPS = ("hysteresis.presliding", "hysteresis.bouc_wen")


SAME = {"change.step": ("friction.coulomb",), "friction.capstan": ("friction.load",)}
"""Family to others with the same columns: declared friction may have another level in some runs,
and a cable over one wrap rubs in proportion to its load, but for what the ratio takes up."""


def rubbing(place: str, family: str, variables: tuple[str, ...], *tables: Drawer) -> Recipe:
    """Return a recipe of friction whose level is a product of tables drawn by functions."""

    def recipe(random: Random, ranges: Ranges) -> Drawn:
        made = tuple(table(random, ranges) for table in tables)
        dwell = over(random, 0.2, 1.5), over(random, 0.02, 0.3)
        part = Hidden(place, "table", made, friction=True, dwell_s=dwell)
        same = SAME.get(family, ())
        return Drawn(WORDS[place], family, variables, part, ranges.level(place), same)

    return recipe


def slow(place: str, random: Random, ranges: Ranges) -> Table:
    """Draw a level that falls with the size of the speed."""
    return ranges.way(f"{place}_way", falling(random, grid() / random.uniform(0.05, 0.3)))


def loaded(place: str, random: Random, ranges: Ranges) -> Table:
    """Draw a level that grows with the load, of either sign."""
    return ranges.sided(LOADS[place], power(random, 0.6, 1.7), odd=False)


def along(random: Random, ranges: Ranges) -> Table:
    """Draw a level that goes slowly with the spindle's angle."""
    forms = (
        rising(random),
        1.0 - rising(random),
        np.exp(0.8 * smooth(random, random.uniform(0.5, 0.9))),
    )
    form = forms[int(random.integers(len(forms)))]
    return ranges.table("spindle_angle", form - form.min())


def fading(random: Random, ranges: Ranges) -> Table:
    """Draw a level that fades or grows with time, in each run or over the campaign."""
    clock = "campaign_time" if random.random() < 0.4 else "run_time"
    form = course(random, grid())
    form = form - form.min()
    return ranges.table(clock, form.max() - form if random.random() < 0.6 else form)


def fading_within(random: Random, ranges: Ranges) -> Table:
    """Draw a level that goes towards another one in each run."""
    time = random.uniform(0.15, 0.8)
    form = (1.0 - np.exp(-grid() / time)) * bend(random, 0.15)
    return ranges.table("run_time", form.max() - form if random.random() < 0.5 else form)


def stepping(random: Random, ranges: Ranges) -> Table:
    """Draw a level that comes at one moment of each run or of the campaign."""
    clock = "campaign_time" if random.random() < 0.4 else "run_time"
    sharp = random.uniform(0.002, 0.015)
    return ranges.table(clock, 0.5 + 0.5 * np.tanh((grid() - random.uniform(0.3, 0.7)) / sharp))


def rested(random: Random, ranges: Ranges) -> Table:
    """Draw a level that grows with rest."""
    return ranges.table("dwell", rising(random))


def sided_share(random: Random, ranges: Ranges) -> Table:
    """Draw a factor that differs by the direction of the spindle."""
    share, width = random.uniform(0.15, 0.4), random.uniform(0.01, 0.05)
    x = ranges.table("spindle_speed").x / ranges.size("spindle_speed")
    return ranges.table("spindle_speed", 1.0 + share * np.tanh(x / width))


def speeding(
    place: str,
    family: str,
    form: tuple[float, float, bool],
    random: Random,
    ranges: Ranges,
) -> Drawn:
    """Draw a torque that is a distorted power of the speed: least and most power, and if odd."""
    low, high, odd = form
    table = ranges.sided(f"{place}_speed", power(random, low, high), odd)
    return Drawn(
        WORDS[place], family, ("velocity",), Hidden(place, "table", (table,)),
        ranges.level(place),
    )  # fmt: skip


def load_viscous(random: Random, ranges: Ranges) -> Drawn:
    """Draw a loss of the gear that grows with load and speed."""
    tables = (
        ranges.sided("motor_speed", power(random, 0.7, 1.3), odd=True),
        ranges.sided("gear_torque", power(random, 0.7, 1.5), odd=False),
    )
    return Drawn(
        WORDS["motor"], "friction.load_viscous", ("velocity", "load"),
        Hidden("motor", "table", tables), ranges.level("motor"),
    )  # fmt: skip


def loop(place: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw friction that builds up over a way after each reversal."""
    variable = f"{place}_angle"
    reach = ranges.span(variable) * over(random, 0.02, 0.15)
    kind, reaches, weights = bank(random, reach)
    part = Hidden(place, kind, (ranges.table(variable),), reach=reaches, weights=weights)
    family = LOOPS[kind == "bouc_wen"]
    return Drawn(WORDS[place], family, (variable, "history"), part, ranges.level(place), LOOPS)


def _recipes() -> dict[str, Recipe]:
    found: dict[str, Recipe] = {
        "friction.load_viscous motor": load_viscous,
        "friction.capstan spindle": rubbing(
            "spindle",
            "friction.capstan",
            ("load", "velocity_sign"),
            partial(loaded, "spindle"),
            sided_share,
        ),
    }
    for place in WORDS:
        for family, variables, table in (
            ("friction.stribeck", ("velocity",), partial(slow, place)),
            ("friction.load", ("load", "velocity_sign"), partial(loaded, place)),
            ("friction.position", ("spindle_angle", "velocity_sign"), along),
            ("friction.warmup", ("time", "velocity_sign"), fading),
            ("change.step", ("time", "velocity_sign"), stepping),
            ("friction.dwell", ("dwell", "velocity_sign"), rested),
        ):
            found[f"{family} {place}"] = rubbing(place, family, variables, table)
        found[f"friction.drag {place}"] = partial(
            speeding, place, "friction.drag", (1.7, 3.0, True)
        )
        asymmetric = partial(speeding, place, "friction.viscous_asymmetry", (0.8, 1.4, False))
        found[f"friction.viscous_asymmetry {place}"] = asymmetric
        found[f"hysteresis.presliding {place}"] = partial(loop, place)
    return found


FRICTIONS = _recipes()

WITHIN: dict[str, Recipe] = {
    f"friction.warmup {place} within": rubbing(
        place, "friction.warmup", ("time", "velocity_sign"), fading_within
    )
    for place in WORDS
}
"""Frictions of which runs that all load alike show no more than that they go with time."""
