"""Recipes outside the catalogue: functions of variables that no family of it has."""

from functools import partial

import numpy as np

from benchmarks.rigs.drawn import Drawn, Ranges, Recipe
from benchmarks.rigs.frictions import LOADS, WORDS, loaded, rubbing
from benchmarks.rigs.hidden import Hidden, Table
from benchmarks.rigs.plant import over
from rig.simulation.forms import Random, falling, grid, relays, smooth, spots

UNKNOWN = "unknown"


def tight(random: Random, ranges: Ranges) -> Table:
    """Draw spots along the spindle's angle."""
    return ranges.table("spindle_angle", spots(random))


def pushed(random: Random, ranges: Ranges) -> Table:
    """Draw a level over acceleration: less, or more, near none of it."""
    size = ranges.size("acceleration")
    x = np.linspace(-1.0, 1.0, 257)
    form = falling(random, grid() / random.uniform(0.05, 0.2))
    values = np.interp(np.abs(x), grid(), form)
    return Table("acceleration", -size, size, values if random.random() < 0.5 else 1.0 - values)


def windowed(place: str, random: Random, ranges: Ranges) -> Table:
    """Draw a level that is there at some loads only."""
    return ranges.table(LOADS[place], spots(random, 1, 0.06, 0.15))


def aged(random: Random, ranges: Ranges) -> Table:
    """Draw a level that is there after rests of some length only."""
    return ranges.table("dwell", spots(random, 1, 0.08, 0.2))


def jumping(random: Random, ranges: Ranges) -> Table:
    """Draw a level that switches at random times."""
    return Table("jump", 0.0, 1.0, grid())


def beyond(place: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw drag on one part of the travel only."""
    x = grid() - random.uniform(0.35, 0.65)
    side = 0.5 + 0.5 * np.tanh(x / random.uniform(0.03, 0.1)) * random.choice([-1.0, 1.0])
    tables = (
        ranges.sided(f"{place}_speed", lambda size: size, odd=True),
        ranges.table("spindle_angle", side),
    )
    part = Hidden(place, "table", tables)
    return Drawn(WORDS[place], UNKNOWN, ("velocity", "spindle_angle"), part, ranges.level(place))


def switching(place: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw friction that comes on at high speed and goes off at low speed."""
    fast = ranges.high[f"{place}_way"]
    reach = np.zeros(80)
    reach[0], reach[40] = random.uniform(0.35, 0.6) * fast, random.uniform(0.08, 0.25) * fast
    part = Hidden(
        place, "relays", (ranges.way(f"{place}_way", grid()),), friction=True,
        reach=reach, weights=np.ones(1),
    )  # fmt: skip
    variables = ("velocity", "history", "velocity_sign")
    return Drawn(WORDS[place], UNKNOWN, variables, part, ranges.level(place))


def latching(place: str, random: Random, ranges: Ranges) -> Drawn:
    """Draw catches along the travel, each of which holds on one way and lets go on the other."""
    variable = f"{place}_angle"
    span, middle = ranges.span(variable), 0.5 * (ranges.low[variable] + ranges.high[variable])
    reach, weights = relays(random, span * over(random, 0.02, 0.15))
    along = middle + 0.4 * span * random.uniform(-1.0, 1.0, len(weights))
    part = Hidden(
        place, "relays", (ranges.table(variable),),
        reach=reach + np.tile(along, 2), weights=weights,
    )  # fmt: skip
    return Drawn(WORDS[place], UNKNOWN, (variable, "history"), part, ranges.level(place))


def notch(random: Random, ranges: Ranges) -> Drawn:
    """Draw a notch that the jaw falls into."""
    form = np.gradient(spots(random, 1, 0.06, 0.14), grid())
    table = ranges.table("jaw_angle", form / np.max(np.abs(form)))
    return Drawn(
        "jaw", UNKNOWN, ("jaw_angle",), Hidden("jaw", "table", (table,)), ranges.level("jaw")
    )


def folded(random: Random, ranges: Ranges) -> Drawn:
    """Draw a cable whose give under load differs along the travel, by no wave."""
    tables = (
        ranges.sided("stretch", lambda size: size, odd=True),
        ranges.table("spindle_angle", smooth(random, random.uniform(0.12, 0.25))),
    )
    part = Hidden("cable", "table", tables)
    guess = 0.05 * ranges.size("stretch")
    return Drawn("cable", UNKNOWN, ("load", "spindle_angle"), part, guess)


def _recipes() -> dict[str, Recipe]:
    found: dict[str, Recipe] = {"unknown jaw notch": notch, "unknown cable fold": folded}
    for place in WORDS:
        along = ("spindle_angle", "velocity_sign")
        found[f"unknown {place} tight spot"] = rubbing(place, UNKNOWN, along, tight)
        found[f"unknown {place} worn spot"] = rubbing(
            place,
            UNKNOWN,
            ("spindle_angle", "load", "velocity_sign"),
            tight,
            partial(loaded, place),
        )
        found[f"unknown {place} pushed"] = rubbing(
            place, UNKNOWN, ("acceleration", "velocity_sign"), pushed
        )
        found[f"unknown {place} load window"] = rubbing(
            place, UNKNOWN, ("load", "velocity_sign"), partial(windowed, place)
        )
        found[f"unknown {place} age window"] = rubbing(
            place, UNKNOWN, ("dwell", "velocity_sign"), aged
        )
        found[f"unknown {place} jumps"] = rubbing(place, UNKNOWN, ("velocity_sign",), jumping)
        found[f"unknown {place} drag beyond"] = partial(beyond, place)
        found[f"unknown {place} switching"] = partial(switching, place)
        found[f"unknown {place} latching"] = partial(latching, place)
    return found


OUTSIDE: dict[str, Recipe] = _recipes()
