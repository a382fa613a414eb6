"""Zhang et al. 2022 on simulated seven-joint arms: all seeds, kept as they are done."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from estimation.arm.kinematics import pinocchio
from estimation.networks.training import require_torch
from estimation.recording import FloatArray
from rig.arm.hidden import FAMILIES, OWN
from rig.arm.simulated import draw_arm
from rig.output.provenance import Provenance
from rig.studies.families import arm_of, near
from rig.studies.seeds import Keeper, begin_learning, kept_outcomes
from rig.studies.zhang import free
from rig.studies.zhang.forces import Learnt, grasps, in_contact, turning
from rig.studies.zhang.free import NETWORKS, Cells
from rig.studies.zhang.psm import with_instrument

SCHEMA = "rig.study.zhang/2"

STREAM = 20220
"""Of random numbers: other arms than those on which the simulation was chosen."""

TABLE_2 = {
    "CF": (26.662, 6.033), "LTF": (29.942, 7.722), "MCS": (29.087, 5.039), "MBF": (30.919, 7.768),
    "PF": (20.750, 4.985), "RF": (26.734, 6.878), "SCA": (38.384, 5.391),
}  # fmt: skip
"""The paper's NRMSE of each instrument before and after transfer, %."""

PAPER: dict[str, tuple[float | None, ...]] = {
    "I | C on C": (5.29, 5.73, 7.72, 3.50, 3.69, 3.69),
    "I | M on M": (6.50, 6.98, 5.72, 1.99, 3.34, 3.64),
    "I | C on M": (None, None, 7.51, None, None, None),
    "I | M on C": (6.14, 7.73, 10.24, 3.99, 5.06, 7.71),
    "I | M+C on M": (None, None, 6.11, None, None, None),
    "I | M+C on C": (6.04, 5.88, 7.20, 3.67, 3.74, 3.81),
    **{f"II before | {name}": (before,) for name, (before, _) in TABLE_2.items()},
    **{f"II after | {name}": (after,) for name, (_, after) in TABLE_2.items()},
    "grasp | RMSE, NRMSE, scale": (0.37, 8.73, 50.0),
}
"""The paper's numbers; None where our copy of the paper has lost them."""

PAPER_FORCE_N, PAPER_MOMENT_N_M, PAPER_GRASP_N = 1.4, (0.04, 0.06), 0.1
"""Largest RMSE of an axis in contact; of the moment, the abstract's and section IV-D's."""


@dataclass(frozen=True)
class Outcome:
    """Results of one arm."""

    cells: Cells
    traces: Cells  # forces over time by `experiment | what`, N
    # names of the effects found on the arm with the Cadiere Forceps, in order
    effects: tuple[str, ...]


@dataclass(frozen=True)
class ZhangStudy:
    """Results of the study."""

    schema: str
    seeds: int  # arms of each family of hidden torque
    # of each arm, in the order of their numbers, its errors by `experiment | condition | method`
    outcomes: tuple[Cells, ...]
    traces: Cells  # forces over time of the first arm, by `experiment | what`
    effects: dict[str, int]
    provenance: Provenance

    def values(self, cell: str, family: str = OWN) -> FloatArray:
        """Return one cell's numbers over a family's arms, shape (arms, numbers)."""
        first = FAMILIES.index(family)
        return np.array([outcome[cell] for outcome in self.outcomes[first :: len(FAMILIES)]])

    def median(self, cell: str) -> FloatArray:
        """Return the medians over the arms with the simulation's own torque, shape (numbers,)."""
        return np.median(self.values(cell), axis=0)

    def near(self, condition: str) -> list[bool | None]:
        """Return for each of the paper's numbers whether its method comes near it here.

        The median over the arms that were matched counts; None where the paper's is not known.
        """
        return near(self.median(f"{condition} | {NETWORKS}"), PAPER[condition])

    def near_in_contact(self) -> list[bool | None]:
        """Return whether force, moment (by either of its numbers) and grasp land near."""
        force, moment, grasp = worst_axes(self.median(f"contact | wrench, grasp | {NETWORKS}"))
        either = any(near([moment] * len(PAPER_MOMENT_N_M), PAPER_MOMENT_N_M))
        return [*near([force], [PAPER_FORCE_N]), either, *near([grasp], [PAPER_GRASP_N])]


def worst_axes(contact: FloatArray) -> tuple[float, float, float]:
    """Return the largest force error, the largest moment error and the grasp's of a contact."""
    return float(contact[:3].max()), float(contact[3:6].max()), float(contact[6])


def one_arm(number: int) -> Outcome:
    """Do all experiments on one arm."""
    seed, family = arm_of(number)
    rng = np.random.default_rng([seed, STREAM])
    forceps = free.of_family(with_instrument(rng, draw_arm(rng), "CF"), family, seed)
    splits = {name: free.free_runs(forceps, rng, name == "M") for name in ("C", "M")}
    networks, cells = free.table_1(splits, seed)
    physics, ours = free.fitted_physics(forceps, splits)
    cells |= ours | free.short_networks(splits, seed)
    cells |= free.figure_3(forceps, rng)
    gripper, other = free.table_2(forceps, rng, seed, family)
    cells |= other
    learnt = Learnt(forceps, networks, gripper, physics)
    cells |= turning(learnt, rng)
    traces: Cells = {}
    for experiment in (grasps, in_contact):
        errors, forces = experiment(learnt, rng)
        cells |= errors
        traces |= forces
    return Outcome(cells, traces, tuple(effect.name for effect in physics.effects))


def run(seeds: int, keeper: Keeper) -> ZhangStudy:
    """Do the study on so many arms of every family, from seed 0.

    Raises:
        MissingExtraError: torch or Pinocchio is missing.
        OSError: The folder cannot be written.
    """
    require_torch()
    pinocchio()
    arms = seeds * len(FAMILIES)
    outcomes = kept_outcomes(Outcome, one_arm, arms, SCHEMA, keeper, start=begin_learning)
    found = Counter(name for outcome in outcomes for name in outcome.effects)
    return ZhangStudy(
        schema=SCHEMA,
        seeds=seeds,
        outcomes=tuple(outcome.cells for outcome in outcomes),
        traces=outcomes[0].traces,
        effects=dict(found.most_common()),
        provenance=Provenance.now(0),
    )
