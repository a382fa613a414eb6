"""Zhao and Nelson 2016 on simulated graspers: their method, and ours, in their three experiments.

The diagnosis looks at one grasper of each family of hidden friction, which is not reported; what it
names is added on all the others of that family.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product

from estimation.model import Model
from estimation.model_file import parse
from rig.grasper.current_force import CurrentForce
from rig.grasper.hidden import FAMILIES
from rig.grasper.plant import PROTOTYPES
from rig.studies.families import arm_of
from rig.studies.seeds import Keeper, kept_outcomes
from rig.studies.zhao.methods import (
    DOFS,
    Axes,
    Lacking,
    Outcome,
    axes_of,
    declared,
    fitted,
    lacking,
    of_current,
    of_model,
    outcome,
    report_runs,
    slope,
)

SCHEMA = "rig.study.zhao/2"

Added = Mapping[tuple[str, str], Lacking]

LOOKED_AT = 1000
"""Seed of the graspers that the diagnosis looks at, one a family; they are not reported."""


@dataclass(frozen=True)
class Cell:
    """One degree of freedom of one grasper."""

    seed: int
    # of the paper's estimate over force in long steady grasps; one over its coefficient
    slope: float
    paper: Outcome
    ours: Outcome  # the declared model with the added effects
    undeclared: Outcome  # the declared model alone, fitted on the same runs


@dataclass(frozen=True)
class Study:
    """The whole study."""

    prototype: str
    spread: float
    # degree of freedom to its cells, one a grasper, in the order of their numbers
    cells: Mapping[str, Sequence[Cell]]
    # family and degree of freedom to what the diagnosis found on the grasper it looked at, and what
    # was therefore added to ours
    lacking: Mapping[tuple[str, str], Lacking] = field(default_factory=dict)


def look(prototype: str, spread: float, number: int) -> Lacking:
    """Diagnose a degree of freedom's model on a grasper of one family that is not reported."""
    family, dof = FAMILIES[number // len(DOFS)], DOFS[number % len(DOFS)]
    return lacking(dof, axes_of(PROTOTYPES[prototype], dof, LOOKED_AT, spread, family), LOOKED_AT)


def one_grasper(prototype: str, spread: float, added: Added, number: int) -> tuple[Cell, ...]:
    """Measure all degrees of freedom of one grasper, in the order of `DOFS`."""
    seed, family = arm_of(number, FAMILIES)
    axes = {dof: axes_of(PROTOTYPES[prototype], dof, seed, spread, family) for dof in DOFS}
    return tuple(measure(dof, axes[dof], seed, parse(added[family, dof].model)) for dof in DOFS)


def measure(dof: str, axes: Axes, seed: int, model: Model) -> Cell:
    """Calibrate both methods on some runs of a grasper and report them on others."""
    arm_m = axes[0].arm_m
    method = CurrentForce(arm_m)
    steep = slope(dof, axes, method, seed * 1000 + 500)
    tests = report_runs(dof, axes, seed * 1000 + 700)
    ways = [
        of_current(dof, replace(method, coefficient=1.0 / steep)),
        of_model(fitted(dof, axes, seed, model), arm_m),
        of_model(fitted(dof, axes, seed, declared(dof)), arm_m),
    ]
    return Cell(seed, steep, *(outcome(dof, tests, way, arm_m) for way in ways))


def run_study(prototype: str, seeds: int, spread: float, keeper: Keeper) -> Study:
    """Run the three experiments on graspers of one make of `PROTOTYPES`, `seeds` of each family."""
    name = f"{SCHEMA} {prototype} {spread:g}"
    every = len(FAMILIES) * len(DOFS)
    diagnosed = partial(look, prototype, spread)
    looked = kept_outcomes(Lacking, diagnosed, every, f"{name} diagnosis", keeper)
    lacked = dict(zip(product(FAMILIES, DOFS), looked, strict=True))
    one = partial(one_grasper, prototype, spread, lacked)
    graspers = kept_outcomes(tuple[Cell, ...], one, seeds * len(FAMILIES), name, keeper)
    cells = {dof: [grasper[k] for grasper in graspers] for k, dof in enumerate(DOFS)}
    return Study(PROTOTYPES[prototype].name, spread, cells, lacked)
