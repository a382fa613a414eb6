"""The network rows of Tables I to V of O'Neill et al. 2018, and networks with physical states.

Training takes hours in full, so each network is kept in a folder as soon as it is trained, under a
name made of the data and of all settings; a study that was interrupted goes on where it stopped.
"""

import hashlib
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from estimation.campaign import Campaign
from estimation.networks import network as net
from estimation.networks.network import Network
from estimation.networks.training import Settings, require_torch, train
from estimation.recording import FloatArray
from estimation.scores import Score, score
from rig.output.provenance import Provenance
from rig.studies.oneill.data import ClosingTable, closing_table, held_out_masks, pose_runs
from rig.studies.oneill.network_jobs import CHANNELS, Job, jobs
from rig.studies.oneill.paper import DISTAL, FOLDS, GRIP_ARM_M, PAPER_POSE_SAMPLES, POSES, PROXIMAL
from rig.studies.seeds import begin_learning, in_processes

SCHEMA = "rig.study.network/1"


@dataclass(frozen=True)
class NetworkRow:
    """Error of one job's estimate of one target, in the target's SI unit."""

    pose: str
    way: str
    surrogate: str
    protocol: str
    target: str
    networks: int
    converged: int
    score: Score


@dataclass(frozen=True)
class NetworkStudy:
    """Results."""

    schema: str
    rows: tuple[NetworkRow, ...]
    not_run: tuple[Job, ...]  # jobs that were not, or not wholly, trained
    samples: dict[str, int]
    peak_torque_n_m: float  # largest distal torque of the neutral pose
    every: dict[str, int]  # every n-th closing sample of a pose was trained on, by pose
    settings: Settings
    notes: tuple[str, ...]
    provenance: Provenance

    @property
    def grip_force(self) -> tuple[float, float] | None:
        """Error of the grip force in N and as a share of its peak, command, random split."""
        error = self.rmse("neutral", "end-to-end", "command", "random", DISTAL)
        return None if error is None else (error / GRIP_ARM_M, error / self.peak_torque_n_m)

    def rmse(self, *row: str) -> float | None:
        """Return the error of a row: pose, way, surrogate, protocol and target; None without it."""
        rows = {(r.pose, r.way, r.surrogate, r.protocol, r.target): r for r in self.rows}
        return rows[row].score.rmse if row in rows else None


@dataclass(frozen=True, eq=False)
class Task:
    """One network to train: all a worker needs."""

    job: Job
    path: Path
    rows: FloatArray
    targets: FloatArray
    settings: Settings


@dataclass(frozen=True)
class Training:
    """How long, on what and where networks are trained."""

    state: Path
    # settings of the training; nodes and seed are the study's
    settings: Settings = field(default_factory=Settings)
    # train on every n-th closing sample of the neutral pose, and on as many of others
    every: int = 8
    seed: int = 0  # seed of splits and of first weights
    workers: int = 1  # processes; each trains on one core
    minutes: float = float("inf")  # no network is started after this time


class Trainer:
    """Trains the networks of jobs and keeps them in a folder."""

    def __init__(self, tables: dict[str, ClosingTable], training: Training) -> None:
        self.tables, self.training = tables, training
        self._masks: dict[tuple[str, str], list[np.ndarray]] = {}

    def step(self, pose: str) -> int:
        """Return which n-th samples of a pose are trained on: about as many for every pose."""
        share = len(self.tables[pose].run) / len(self.tables["neutral"].run)
        return max(1, round(self.training.every * share))

    def masks(self, job: Job) -> list[np.ndarray]:
        """Return which samples each split of the job tests on."""
        key = (job.pose, job.protocol)
        if key not in self._masks:
            self._masks[key] = held_out_masks(
                self.tables[job.pose], job.protocol, self.training.seed
            )
        return self._masks[key]

    def missing(self, job: Job) -> dict[Path, tuple[Job, int]]:
        """Return the networks of a job that are still to be trained: file to part and fold."""
        parts = [(part, fold) for part in job.stages for fold in range(len(self.masks(part)))]
        paths = {self.path(*each): each for each in parts}
        return {path: each for path, each in paths.items() if not path.exists()}

    def task(self, path: Path, part: Job, fold: int) -> Task:
        """Return a network's task with its rows and targets."""
        table, kept = self.tables[part.pose], np.flatnonzero(~self.masks(part)[fold])
        kept = kept[:: self.step(part.pose)]
        rows, targets = table[part.inputs][kept], table[part.targets][kept]
        return Task(part, path, rows, targets, self._settings(part))

    def _settings(self, job: Job) -> Settings:
        return replace(self.training.settings, nodes=job.nodes, seed=self.training.seed)

    def path(self, job: Job, fold: int) -> Path:
        """Return where a network is kept: the name changes with all that made it."""
        data = self.tables[job.pose].digest((*job.inputs, *job.targets))
        made_of = (
            SCHEMA, data, job.inputs, job.targets, job.protocol, fold,
            self.step(job.pose), FOLDS, sorted(asdict(self._settings(job)).items()),
        )  # fmt: skip
        name = hashlib.sha256(repr(made_of).encode()).hexdigest()[:24]
        return self.training.state / f"{name}.npz"

    def rows(self, job: Job) -> list[NetworkRow]:
        """Return the errors of a job whose networks are all trained."""
        table = self.tables[job.pose]
        estimates, truths = [], []
        converged = 0
        *before, last = job.stages
        for fold, mask in enumerate(self.masks(job)):
            rows = table[last.inputs][mask]
            for first in before:
                torque = _kept(self.path(first, fold))[0](table[first.inputs][mask])
                rows[:, last.inputs.index(PROXIMAL)] = torque[:, 0]
            network, done = _kept(self.path(last, fold))
            converged += done
            estimates.append(network(rows))
            truths.append(table[job.targets][mask])
        estimate, truth = np.concatenate(estimates), np.concatenate(truths)
        return [
            NetworkRow(
                job.pose, job.way, job.surrogate, job.protocol, target,
                len(estimates), converged, score(estimate[:, k], truth[:, k]),
            )
            for k, target in enumerate(job.targets)
        ]  # fmt: skip


def network_tables(
    neutral: Campaign, folder: Path | None, on_run: Callable[[str], None] = lambda name: None
) -> tuple[dict[str, ClosingTable], tuple[str, ...]]:
    """Return the closing samples by pose, and remarks about them; the folder is as of `pose_runs`.

    Raises:
        DataError: A run is damaged, or nothing is left.
        MissingChannelError: A run lacks a channel.
    """
    tables = {"neutral": closing_table(neutral.evidence, CHANNELS, on_run=on_run)}
    notes = []
    for pose in ("pitch", "roll"):
        runs = pose_runs(folder, pose)
        if runs is None:
            notes.append(f"No data of experiment 3, {pose}: its rows are left out.")
        else:
            tables[pose] = closing_table(runs.evidence, CHANNELS, [POSES[pose]], on_run)
    if len(tables) == 3:
        count = sum(len(tables[pose].run) for pose in ("pitch", "roll"))
        same = "the paper's count" if count == PAPER_POSE_SAMPLES else "the paper has 962,936"
        notes.append(f"Experiment 3 has {count:,} closing samples: {same}.")
    return tables, tuple(notes)


def train_task(task: Task) -> None:
    """Train one network and keep it."""
    names = (task.job.inputs, task.job.targets)
    trained = train(task.rows, task.targets, names, task.settings)
    arrays = {"converged": np.array(trained.converged), **net.to_arrays(trained.network)}
    net.write_arrays(task.path, SCHEMA, arrays)


def _kept(path: Path) -> tuple[Network, int]:
    arrays = net.read_arrays(path, SCHEMA)
    return net.from_arrays(arrays), int(arrays["converged"])


def run_networks(
    tables: dict[str, ClosingTable],
    training: Training,
    notes: tuple[str, ...] = (),
    on_network: Callable[[int, int], None] = lambda done, total: None,
) -> NetworkStudy:
    """Train what is not trained yet on closing samples by pose, and score all that is.

    Raises:
        MissingExtraError: torch is missing.
        NetworkError: A kept network is damaged.
    """
    require_torch()
    trainer = Trainer(tables, training)
    planned = [job for job in jobs(tuple(tables)) if trainer.masks(job)]
    waiting = {path: each for job in planned for path, each in trainer.missing(job).items()}
    until_s = time.monotonic() + 60 * training.minutes
    if waiting:
        on_network(0, len(waiting))
    trained = in_processes(
        train_task,
        (trainer.task(path, *each) for path, each in waiting.items()),
        training.workers,
        begin_learning,
        lambda: time.monotonic() < until_s,
    )
    for done, _ in enumerate(trained, start=1):
        on_network(done, len(waiting))
    rows: list[NetworkRow] = []
    not_run = []
    for job in planned:
        if trainer.missing(job):
            not_run.append(job)
        else:
            rows += trainer.rows(job)
    neutral = tables["neutral"]
    return NetworkStudy(
        schema="rig.study.oneill-networks/1",
        rows=tuple(rows),
        not_run=tuple(not_run),
        samples={pose: len(table.run) for pose, table in tables.items()},
        peak_torque_n_m=float(np.max(neutral.column(DISTAL))),
        every={pose: trainer.step(pose) for pose in tables},
        settings=training.settings,
        notes=notes,
        provenance=Provenance.now(training.seed),
    )
