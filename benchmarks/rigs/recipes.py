"""Which recipes a kind of case draws from. A recipe's name begins with its family."""

from collections.abc import Mapping

from benchmarks.rigs.broken import BROKEN
from benchmarks.rigs.drawn import Recipe
from benchmarks.rigs.drives import DRIVES
from benchmarks.rigs.frictions import FRICTIONS, WITHIN
from benchmarks.rigs.outside import OUTSIDE
from rig.simulation.forms import Random

KINDS = ("strong", "weak", "pair", "outside", "some_runs", "confounded", "clean")

STRENGTHS = {
    "strong": (2.2, 5.0),
    "weak": (1.25, 1.9),
    "pair": (2.2, 5.0),
    "outside": (2.2, 5.0),
    "some_runs": (2.2, 5.0),
    "confounded": (1.4, 4.0),
}
"""Kind to the strength of each of its effects, see `benchmarks.rigs.strength`."""

CATALOGUED: Mapping[str, Recipe] = {**FRICTIONS, **DRIVES, **BROKEN}
RECIPES: Mapping[str, Recipe] = {**CATALOGUED, **WITHIN, **OUTSIDE}

CONFOUNDING = {
    "load_position": (
        "friction.load motor",
        "friction.load spindle",
        "friction.position motor",
        "friction.position spindle",
    ),
    "load_time": (
        "friction.load motor",
        "friction.load spindle",
        *WITHIN,
    ),
}
"""Load of a protocol that confounds to what is hidden under it."""


def family_of(name: str) -> str:
    """Return the family a recipe draws."""
    return name.split()[0]


def needs_rest(name: str) -> bool:
    """Whether a recipe's effect shows only where the motion rests."""
    return "dwell" in name or "age" in name.split()


def recipes_for(random: Random, kind: str) -> tuple[tuple[str, ...], str | None]:
    """Draw which recipes a case takes, and its protocol's load where the kind fixes it.

    Families come equally often, whatever the number of their recipes.
    """
    if kind == "clean":
        return (), None
    if kind == "confounded":
        load = str(random.choice(list(CONFOUNDING)))
        return (str(random.choice(CONFOUNDING[load])),), load
    if kind == "outside":
        return (str(random.choice(list(OUTSIDE))),), None
    by_family: dict[str, list[str]] = {}
    for name in CATALOGUED:
        by_family.setdefault(family_of(name), []).append(name)
    count = 2 if kind == "pair" else 1
    families = random.choice(sorted(by_family), count, replace=False)
    return tuple(str(random.choice(by_family[str(family)])) for family in families), None
