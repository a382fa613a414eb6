"""All experiments of Zhang et al. 2022 on one simulated arm."""

from dataclasses import dataclass

import numpy as np

from rig.arm.simulated import draw_arm
from rig.studies.families import arm_of
from rig.studies.zhang.forces import Learnt, grasps, in_contact, turning
from rig.studies.zhang.free import (
    Cells,
    figure_3,
    fitted_physics,
    free_runs,
    of_family,
    short_networks,
    table_1,
    table_2,
)
from rig.studies.zhang.psm import with_instrument

STREAM = 20220
"""Of random numbers: other arms than those on which the simulation was chosen."""


@dataclass(frozen=True)
class Outcome:
    """Results of one arm.

    Attributes:
        cells: Its errors.
        traces: Forces over time by `experiment | what`, N.
        effects: Names of the effects found on the arm with the Cadiere Forceps, in order.
    """

    cells: Cells
    traces: Cells
    effects: tuple[str, ...]


def one_arm(number: int) -> Outcome:
    """Do all experiments on one arm."""
    seed, family = arm_of(number)
    rng = np.random.default_rng([seed, STREAM])
    forceps = of_family(with_instrument(rng, draw_arm(rng), "CF"), family, seed)
    splits = {name: free_runs(forceps, rng, name == "M") for name in ("C", "M")}
    networks, cells = table_1(splits, seed)
    physics, ours = fitted_physics(forceps, splits)
    cells |= ours | short_networks(splits, seed)
    cells |= figure_3(forceps, rng)
    gripper, other = table_2(forceps, rng, seed, family)
    cells |= other
    learnt = Learnt(forceps, networks, gripper, physics)
    cells |= turning(learnt, rng)
    traces: Cells = {}
    for experiment in (grasps, in_contact):
        errors, forces = experiment(learnt, rng)
        cells |= errors
        traces |= forces
    return Outcome(cells, traces, tuple(effect.name for effect in physics.effects))
