"""The loop closed on measured data: from a linear model to effects confirmed on held-out test runs.

Each row starts from the paper's linear model of one torque, adds effects of the catalogue on two
thirds of the runs while these predict runs left out better, and uses the others once, at the end.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimation.campaign import Campaign
from estimation.diagnosis.split import Sealed, split
from estimation.effects import effect
from estimation.fit_problem import prepared
from estimation.model import Model, Term, estimate
from estimation.recording import FloatArray, Recording
from estimation.signals import Samples
from rig.errors import DataError
from rig.importers.registry import open_campaign
from rig.output.provenance import Provenance
from rig.simulation.reference_roles import MOTOR_LOAD, candidates
from rig.studies.loop.selection import Chosen, grid, selected

TIMELESS = (
    "change.step",
    "friction.warmup",
    "motor.thermal",
    "sensor.drift",
    "transmission.thermal",
)
"""Excluded families: they depend on the time since the start, which is irrelevant to a new load."""


@dataclass(frozen=True)
class Task:
    """One row of the study."""

    name: str  # target and regressor of the estimate
    balance: str  # equation whose effects are searched
    target: str
    source: str  # channel of the linear model
    measured: tuple[str, ...]  # channels an effect may read, besides the device's clock
    instead: Mapping[str, str]  # channel to the one that plays its roles here
    samples: Samples
    parameters: int  # named parameters at most
    to_reach: float  # error to reach, N m
    beyond: float  # a better one, N m


_COMMAND = "motor_command_ratio"
_PROXIMAL = "proximal_torque_n_m"
_FROM_COMMAND = (
    "motor",
    _PROXIMAL,
    _COMMAND,
    (_COMMAND, "motor_angle_rad", "spindle_angle_rad"),
    {"motor_current_a": _COMMAND, MOTOR_LOAD: _COMMAND, "jaw_angle_rad": "spindle_angle_rad"},
)
_FROM_PROXIMAL = (
    "grasp",
    "distal_torque_n_m",
    _PROXIMAL,
    (_PROXIMAL, "motor_angle_rad", "spindle_angle_rad"),
    {
        "motor_current_a": _PROXIMAL,
        MOTOR_LOAD: _PROXIMAL,
        "motor_velocity_rad_s": "spindle_velocity_rad_s",
        "motor_acceleration_rad_s2": "spindle_acceleration_rad_s2",
    },
)

TASKS = (
    Task("proximal torque from command", *_FROM_COMMAND, "closing", 15, 4.0e-3, 3.0e-3),
    Task("proximal torque from command", *_FROM_COMMAND, "all", 15, 12e-3, 7e-3),
    Task("distal torque from proximal torque", *_FROM_PROXIMAL, "closing", 15, 2.5e-3, 1.8e-3),
    Task("distal torque from proximal torque", *_FROM_PROXIMAL, "all", 40, 6e-3, 4e-3),
)


@dataclass(frozen=True)
class Step:
    """One effect added."""

    effect: str  # id of its form
    parameters: int
    gain: float  # share of squared error it removed from training runs left out
    rmse: float  # error on the test runs with it and those before it, means included, N m


@dataclass(frozen=True)
class Row:
    """The answer to a task."""

    task: Task
    linear: float  # error of the linear model on the test runs, means included, N m
    steps: tuple[Step, ...]  # effects in the order they were added
    parameters: int  # named parameters of the last model
    rmse: float  # its error on the test runs, means included, N m
    rmse_without_means: float  # the same with each run's mean error removed
    runs_improved: int  # test runs whose error fell
    rmse_by_run: Mapping[str, tuple[float, float]]  # test run to the error before and after, N m
    families: int
    candidates: int


@dataclass(frozen=True)
class LoopStudy:
    """The whole study."""

    rows: tuple[Row, ...]
    sealed: Sealed  # the split, the same for every task
    left_out: Mapping[str, str]  # runs left out of evidence, with the reason
    source: str
    provenance: Provenance


def run_study(
    data: Path,
    seed: int = 0,
    tasks: Sequence[Task] = TASKS,
    on_stage: Callable[[str], None] = lambda _: None,
) -> LoopStudy:
    """Close the loop on a file, folder or archive of recordings.

    Raises:
        UsageError: The path does not exist.
        DataError: It cannot be read, or lacks a channel.
        EstimationError: The runs cannot be split or fitted.
    """
    on_stage("reading the recordings")
    campaign = open_campaign(data)
    recordings = list(campaign.evidence)
    sealed = split(recordings, seed)
    rows = tuple(_row(task, recordings, sealed, on_stage) for task in tasks)
    left_out = {r.name: r.excluded for r in campaign if r.excluded is not None}
    return LoopStudy(rows, sealed, left_out, str(data.name), Provenance.now(seed))


def _row(
    task: Task, recordings: Sequence[Recording], sealed: Sealed, on_stage: Callable[[str], None]
) -> Row:
    common = {*recordings[0].columns}.intersection(*(r.columns for r in recordings))
    missing = {task.target, *task.measured} - common
    if missing:
        raise DataError(
            f"The recordings lack {', '.join(sorted(missing))}.",
            f"The {task.name} is studied with them.",
        )
    what = f"{task.name}, {task.samples} samples"
    on_stage(f"{what}: linear model")
    declared = _linear(task)
    campaign = Campaign.of([r for r in recordings if r.name in sealed.discover])
    offered = candidates(task.balance, task.measured, task.instead, at_rest=True)
    tried = [term for term in offered if term.effect.family not in TIMELESS]

    def found(step: Chosen) -> None:
        name = step.model.terms[-1].effect.id
        on_stage(f"{what}: {name} removes {100 * step.gain:.0f} % of the squared error")

    chosen = selected(declared, campaign, tried, task.parameters, found)
    on_stage(f"{what}: scoring the held-out test runs")
    test = Campaign.of([r for r in recordings if r.name in sealed.confirm])
    return _scored(task, chosen, test, tried)


def _scored(task: Task, chosen: Sequence[Chosen], test: Campaign, tried: Sequence[Term]) -> Row:
    errors = [_errors(one.model, test) for one in chosen]
    samples = sum(len(e) for e in errors[0].values())
    totals = [float(np.sqrt(sum(float(e @ e) for e in es.values()) / samples)) for es in errors]
    centred = sum(float(np.sum((e - e.mean()) ** 2)) for e in errors[-1].values())
    by_run = {
        name: (float(np.sqrt(np.mean(a**2))), float(np.sqrt(np.mean(errors[-1][name] ** 2))))
        for name, a in errors[0].items()
    }
    steps = [
        Step(one.model.terms[-1].effect.id, len(one.model.terms[-1].parameters), one.gain, total)
        for one, total in zip(chosen[1:], totals[1:], strict=True)
    ]
    return Row(
        task=task,
        linear=totals[0],
        steps=tuple(steps),
        parameters=2 + sum(step.parameters for step in steps),
        rmse=totals[-1],
        rmse_without_means=float(np.sqrt(centred / samples)),
        runs_improved=sum(after < before for before, after in by_run.values()),
        rmse_by_run=by_run,
        families=len({term.effect.family for term in tried}),
        candidates=sum(len(grid(term.effect)) for term in tried),
    )


def _errors(model: Model, test: Campaign) -> dict[str, FloatArray]:
    """Return test run to the residual at the samples that count."""
    return {
        run.whole.name: run.thin[model.target] - estimate(model, run.whole)[run.places]
        for run in prepared(model, test, every=1)
    }


def _linear(task: Task) -> Model:
    """Return the paper's linear model: torque = K source + b."""
    source = Term(effect("motor.torque_constant"), channels={"source": task.source})
    return Model(
        "linear",
        task.balance,
        task.target,
        (source, Term(effect("sensor.offset"))),
        "The linear model of O'Neill et al. 2018, Table I.",
        run_offsets=False,
        counted=task.samples,
    )
