"""Zhao and Nelson 2016 on simulated graspers: their method, and ours, in their three experiments.

The diagnosis looks at one grasper that is not reported; what it names is added on all the others.
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from estimation.effects import effect
from estimation.files import write_text_atomic
from estimation.model import Estimate, Term
from rig.grasper.current_force import CurrentForce
from rig.simulation.grasper_plant import PROTOTYPES
from rig.studies.resumable import results
from rig.studies.zhao_methods import (
    Lacking,
    Outcome,
    axes_of,
    fitted,
    lacking,
    of_current,
    of_model,
    outcome,
    report_runs,
    slope,
)
from rig.studies.zhao_paper import DOFS

LOOKED_AT = 1000
"""Seed of the grasper that the diagnosis looks at; it is not reported."""


@dataclass(frozen=True)
class Cell:
    """One degree of freedom of one grasper.

    Attributes:
        seed: Seed of its hidden parameters.
        slope: Of the paper's estimate over force in long steady grasps; one over its coefficient.
        paper: The paper's method.
        ours: The declared model with the added effects.
        undeclared: The declared model alone, fitted on the same runs.
    """

    seed: int
    slope: float
    paper: Outcome
    ours: Outcome
    undeclared: Outcome


@dataclass(frozen=True)
class Study:
    """The whole study.

    Attributes:
        prototype: Name of the prototype.
        spread: Spread of the hidden parameters.
        cells: Degree of freedom to its cells, one a seed.
        lacking: Degree of freedom to what the diagnosis found on the grasper it looked at, and what
            was therefore added to ours.
    """

    prototype: str
    spread: float
    cells: Mapping[str, Sequence[Cell]]
    lacking: Mapping[str, Lacking] = field(default_factory=dict)


@dataclass(frozen=True)
class Task:
    """One cell to measure: plain data that travels to other processes."""

    prototype: str
    dof: str
    seed: int
    spread: float
    added: tuple[Term, ...]

    @property
    def file(self) -> str:
        """Name of its result; the same task has the same name."""
        return (
            f"{self.prototype}-{self.dof}-{self.seed:03d}-{mark_of(self.spread, self.added)}.json"
        )


def mark_of(spread: float, added: Sequence[Term]) -> str:
    """Return eight digits that differ where the spread or the added effects do."""
    said = [(t.effect.id, sorted((k, v.value) for k, v in t.values.items())) for t in added]
    return hashlib.sha256(json.dumps([spread, said]).encode()).hexdigest()[:8]


def look(prototype: str, dof: str, spread: float, keep: Path | None = None) -> Lacking:
    """Ask the diagnosis what a degree of freedom's model lacks, on the grasper for that."""
    kept = keep / f"{prototype}-{dof}-diagnosis-{spread:g}.json" if keep is not None else None
    if kept is not None and kept.is_file():
        read = json.loads(kept.read_text())
        return Lacking(
            tuple((family, verdict) for family, verdict in read["findings"]),
            tuple(_term(one) for one in read["terms"]),
        )
    found = lacking(dof, axes_of(PROTOTYPES[prototype], dof, LOOKED_AT, spread), LOOKED_AT)
    if keep is not None and kept is not None:
        keep.mkdir(parents=True, exist_ok=True)
        said = {"findings": found.findings, "terms": [_plain(term) for term in found.terms]}
        write_text_atomic(kept, json.dumps(said) + "\n")
    return found


def measure(task: Task) -> Cell:
    """Calibrate both methods on some runs of a grasper and report them on others."""
    dof, seed = task.dof, task.seed
    axes = axes_of(PROTOTYPES[task.prototype], dof, seed, task.spread)
    arm_m = axes[0].arm_m
    method = CurrentForce(arm_m)
    steep = slope(dof, axes, method, seed * 1000 + 500)
    tests = report_runs(dof, axes, seed * 1000 + 700)
    ways = [
        of_current(dof, replace(method, coefficient=1.0 / steep)),
        of_model(fitted(dof, axes, seed, task.added), arm_m),
        of_model(fitted(dof, axes, seed, ()), arm_m),
    ]
    return Cell(seed, steep, *(outcome(dof, tests, way, arm_m) for way in ways))


def run_study(
    prototype: str = "third",
    seeds: Sequence[int] = tuple(range(20)),
    spread: float = 0.1,
    *,
    workers: int = 1,
    keep: Path | None = None,
    on_step: Callable[[str], None] = lambda _: None,
) -> Study:
    """Run the three experiments on graspers of one make.

    Args:
        prototype: `third`, `journal` or `ball`.
        seeds: One grasper each.
        spread: Spread of the hidden parameters from grasper to grasper.
        workers: Processes at once.
        keep: Folder where each cell is kept once it is measured, and not measured again.
        on_step: Told what is done.
    """
    looked = {}
    for dof in DOFS:
        looked[dof] = look(prototype, dof, spread, keep)
        on_step(f"diagnosis of {dof}")
    tasks = [
        Task(prototype, dof, seed, spread, looked[dof].terms) for seed in seeds for dof in DOFS
    ]
    cells: dict[str, list[Cell]] = {dof: [] for dof in DOFS}
    for task, cell in results(tasks, measure, asdict, _cell, workers=workers, keep=keep):
        cells[task.dof].append(cell)
        on_step(f"{task.dof} of grasper {task.seed}")
    return Study(
        PROTOTYPES[prototype].name,
        spread,
        {dof: sorted(found, key=lambda cell: cell.seed) for dof, found in cells.items()},
        looked,
    )


def _cell(told: dict[str, Any]) -> Cell:
    methods = {
        name: Outcome(tuple(told[name]["errors_n"]), told[name]["delay_ms"])
        for name in ("paper", "ours", "undeclared")
    }
    return Cell(told["seed"], told["slope"], **methods)


def _plain(term: Term) -> dict[str, Any]:
    values = {name: estimate.value for name, estimate in term.values.items()}
    return {
        "id": term.effect.id,
        "sign": term.sign,
        "channels": dict(term.channels),
        "values": values,
    }


def _term(told: dict[str, Any]) -> Term:
    values = {name: Estimate(value) for name, value in told["values"].items()}
    return Term(effect(told["id"]), told["sign"], told["channels"], values)
