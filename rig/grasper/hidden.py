"""Hidden friction of the simulated grasper by families, each axis with a form of its own.

A family is a factor on an axis' level of friction: a random table over one variable, of mean 1 over
its usual range. Functions of `rig.simulation.forms` make the tables.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from estimation.recording import FloatArray
from rig.grasper.plant import FORM_VARIABLES, AxisParameters, Form
from rig.simulation.forms import Random, course, falling, grid, power, rising, smooth, spots

OWN = "the simulation's own"
"""Friction in proportion to the load, by which the paper was matched."""

USUAL = {"load": 0.02, "speed": 0.8, "angle": 0.2, "time": 30.0, "acceleration": 12.0}
"""Ranges of the variables in the experiments, from 0: N m, rad/s, rad, s, rad/s^2."""

LEAST = 0.2
"""Share of the mean that stays where a form is least: no bearing is free of friction."""

Drawer = Callable[[Random], FloatArray]

IN_CATALOGUE: Mapping[str, tuple[str, Drawer]] = {
    "curved in the load": ("load", lambda random: power(random, 0.6, 1.7)(grid()) + LEAST),
    "falling with speed": (
        "speed", lambda random: falling(random, grid() / random.uniform(0.05, 0.3)) + LEAST),
    "along the angle": ("angle", lambda random: np.exp(0.8 * smooth(random, 0.7))),
    "changing with time": ("time", lambda random: 1.5 + course(random, grid())),
}  # fmt: skip
"""Family to its variable and form. The catalogue has the family, not the drawn form."""

NOT_IN_CATALOGUE: Mapping[str, tuple[str, Drawer]] = {
    "at some loads only": ("load", lambda random: spots(random, 1, 0.08, 0.2) + LEAST),
    "at some speeds only": ("speed", lambda random: spots(random, 2) + LEAST),
    "at tight spots": ("angle", lambda random: spots(random) + LEAST),
    "by acceleration": ("acceleration", lambda random: rising(random) + LEAST),
}
"""The same for functions that no effect of the catalogue has."""

FAMILIES = (OWN, *IN_CATALOGUE, *NOT_IN_CATALOGUE)


def with_family(axis: AxisParameters, family: str, seed: int) -> AxisParameters:
    """Return an axis whose friction is of a family, with a form drawn by a seed."""
    if family == OWN:
        return axis
    variable, drawer = {**IN_CATALOGUE, **NOT_IN_CATALOGUE}[family]
    values = drawer(np.random.default_rng([seed, FAMILIES.index(family)]))
    place = FORM_VARIABLES.index(variable)
    return replace(axis, form=Form(place, USUAL[variable], values / values.mean()))
