"""The network rows of Tables I to V of O'Neill et al. 2018, and networks with physical states.

Training takes hours in full, so each network is kept in a folder as soon as it is trained, under a
name made of the data and of all settings; a study that was interrupted goes on where it stopped.
"""

import hashlib
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import asdict, dataclass, replace
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread

import numpy as np

from estimation.networks import network as net
from estimation.networks.network import Network
from estimation.networks.training import Settings, require_torch, train
from estimation.recording import FloatArray
from estimation.scores import Score, score
from rig.output.provenance import Provenance
from rig.studies.oneill.closing_table import CAUSAL, ClosingTable, held_out_masks, mapped
from rig.studies.oneill.paper import DISTAL, GRIP_ARM_M, JAW, PROXIMAL

SCHEMA = "rig.study.network/1"
FOLDS = 5
BASE = ("spindle_angle_rad", "spindle_velocity_rad_s")
SURROGATES = {
    "command": ("motor_command_ratio",),
    "current": ("motor_current_a",),
    "gearbox": ("gearbox_differential_rad",),
    "all": ("motor_command_ratio", "motor_current_a", "gearbox_differential_rad"),
    "sensor": (PROXIMAL,),
}
ACCELERATION, TRAVEL = "motor_acceleration_rad_s2", "motor_travel_rad"
POSES = {"neutral": (), "pitch": ("wrist_pitch_rad",), "roll": ("wrist_roll_rad",)}
"""The paper's experiments 1 and 2, and the two halves of experiment 3: inputs each one adds."""

CHANNELS = (
    *BASE, *SURROGATES["all"], PROXIMAL, DISTAL, JAW, ACCELERATION, TRAVEL,
)  # fmt: skip
STATE_NODES = 12
ALONE = (PROXIMAL, DISTAL, JAW)
"""Targets of the networks with physical states, one network each."""

MOTOR = [("end-to-end", "command"), ("end-to-end", "current")]
"""The rows of the paper that the physical states are compared with."""


@dataclass(frozen=True)
class Job:
    """One kind of network under one protocol: a row or two of a table.

    Attributes:
        pose: Key of `POSES`.
        way: `end-to-end` or `staged` as in the paper; `+ acceleration`, `+ travel` for networks
            with physical states, and `causal` for the last of them on channels filtered as live.
        surrogate: Key of `SURROGATES`.
        protocol: As for `held_out_masks`.
        targets: Estimated channels.
    """

    pose: str
    way: str
    surrogate: str
    protocol: str
    targets: tuple[str, ...]

    @property
    def inputs(self) -> tuple[str, ...]:
        """Columns the network reads."""
        states = {"+ acceleration": (ACCELERATION,), "end-to-end": ()}
        own = states.get(self.way, (ACCELERATION, TRAVEL))
        channels = (*BASE, *SURROGATES[self.surrogate], *own)
        if self.way == "causal":
            channels = tuple(CAUSAL + name for name in channels)
        return (*channels, *POSES[self.pose])

    @property
    def nodes(self) -> int:
        """Hidden nodes: the paper's 30, fewer with more informative inputs."""
        return 30 if self.way in ("end-to-end", "staged") else STATE_NODES

    @property
    def stages(self) -> tuple["Job", "Job"]:
        """The networks of a staged job: surrogate to torque, and torque to what is wanted."""
        first = replace(self, way="end-to-end", targets=(PROXIMAL,))
        return first, replace(self, way="end-to-end", surrogate="sensor")


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
    """Results.

    Attributes:
        schema: Name of this layout.
        rows: What was trained.
        not_run: Jobs that were not, or not wholly, trained.
        samples: Closing samples by pose.
        peak_torque_n_m: Largest distal torque of the neutral pose.
        every: Every n-th closing sample of a pose was trained on, by pose.
        settings: Settings of the training.
        notes: Remarks for the reader.
        provenance: When and from what this was made.
    """

    schema: str
    rows: tuple[NetworkRow, ...]
    not_run: tuple[Job, ...]
    samples: dict[str, int]
    peak_torque_n_m: float
    every: dict[str, int]
    settings: Settings
    notes: tuple[str, ...]
    provenance: Provenance

    @property
    def grip_force(self) -> tuple[float, float] | None:
        """Error of the grip force in N and as a share of its peak, command, random split."""
        for row in self.rows:
            own = (row.pose, row.way, row.surrogate, row.protocol, row.target)
            if own == ("neutral", "end-to-end", "command", "random", DISTAL):
                return row.score.rmse / GRIP_ARM_M, row.score.rmse / self.peak_torque_n_m
        return None


Kind = tuple[str, str, str, tuple[str, ...]]
"""Pose, way, surrogate and targets of a job."""


def jobs(poses: tuple[str, ...]) -> list[Job]:
    """Return the rows of the study, the most telling ones first."""
    both = (DISTAL, JAW)
    paper: list[Kind] = []
    paper += [("neutral", "end-to-end", s, (PROXIMAL,)) for s in tuple(SURROGATES)[:4]]
    paper += [("neutral", "end-to-end", s, both) for s in SURROGATES]
    paper += [("neutral", "staged", s, both) for s in tuple(SURROGATES)[:4]]
    posed = [(p, "end-to-end", s, both) for p in ("pitch", "roll") for s in SURROGATES]
    ways = {
        way: [("neutral", way, s, (t,)) for s in ("command", "current") for t in ALONE]
        for way in ("+ travel", "causal", "+ acceleration")
    }
    motor = _motor(paper)
    rest = [kind for kind in paper if kind not in motor]
    posed_states = [(p, "+ travel", "command", (t,)) for p in ("pitch", "roll") for t in both]
    order: list[tuple[str, Sequence[Kind]]] = [
        ("random", paper),
        *(("run-wise", _of(s, [*ways["+ travel"], *motor])) for s in ("command", "current")),
        ("lofo", ways["+ travel"]),
        ("lopo", ways["+ travel"]),
        ("run-wise", [*ways["causal"], *ways["+ acceleration"]]),
        ("lofo", motor),
        ("lopo", motor),
        ("random", posed),
        ("run-wise", _motor(posed)),
        ("run-wise", [*rest, *posed, *posed_states]),
        *((p, rest) for p in ("lofo", "lopo")),
        ("lopo", posed),
        *((p, ways["causal"]) for p in ("lofo", "lopo")),
    ]
    planned = [
        Job(pose, way, surrogate, protocol, targets)
        for protocol, kinds in order
        for pose, way, surrogate, targets in kinds
        if pose in poses
    ]
    return list(dict.fromkeys(planned))


def _motor(kinds: Sequence[Kind]) -> list[Kind]:
    return [kind for kind in kinds if kind[1:3] in MOTOR]


def _of(surrogate: str, kinds: Sequence[Kind]) -> list[Kind]:
    return [kind for kind in kinds if kind[2] == surrogate]


@dataclass(frozen=True)
class Task:
    """One network to train: all a worker needs."""

    job: Job
    fold: int
    train: str  # place of the mapped table
    columns: tuple[str, ...]
    path: str
    rows: np.ndarray
    settings: Settings


class Trainer:
    """Trains the networks of jobs and keeps them in a folder."""

    def __init__(
        self,
        tables: dict[str, ClosingTable],
        state: Path,
        settings: Settings,
        every: int,
        seed: int,
    ) -> None:
        self.tables, self.state, self.settings = tables, state, settings
        self.every, self.seed = every, seed
        self._places = {
            pose: state / f"{pose}-{table.digest(table.columns)}" for pose, table in tables.items()
        }
        self._masks: dict[tuple[str, str], list[np.ndarray]] = {}
        for pose, table in tables.items():
            table.save(self._places[pose])

    def step(self, pose: str) -> int:
        """Return which n-th samples of a pose are trained on: about as many for every pose."""
        share = len(self.tables[pose].run) / len(self.tables["neutral"].run)
        return max(1, round(self.every * share))

    def masks(self, job: Job) -> list[np.ndarray]:
        """Return which samples each split of the job tests on."""
        key = (job.pose, job.protocol)
        if key not in self._masks:
            self._masks[key] = held_out_masks(self.tables[job.pose], job.protocol, FOLDS, self.seed)
        return self._masks[key]

    def tasks(self, job: Job) -> Iterator[Task]:
        """Yield the networks of a job that are still to be trained."""
        for part in job.stages if job.way == "staged" else (job,):
            for fold, mask in enumerate(self.masks(part)):
                path = self.path(part, fold)
                if not path.exists():
                    yield Task(
                        part,
                        fold,
                        str(self._places[part.pose]),
                        self.tables[part.pose].columns,
                        str(path),
                        np.flatnonzero(~mask)[:: self.step(part.pose)],
                        replace(self.settings, nodes=part.nodes, seed=self.seed),
                    )

    def path(self, job: Job, fold: int) -> Path:
        """Return where a network is kept: the name changes with all that made it."""
        data = self.tables[job.pose].digest((*job.inputs, *job.targets))
        settings = replace(self.settings, nodes=job.nodes, seed=self.seed)
        made_of = (
            SCHEMA, data, job.inputs, job.targets, job.protocol, fold,
            self.step(job.pose), FOLDS, sorted(asdict(settings).items()),
        )  # fmt: skip
        return self.state / f"{hashlib.sha256(repr(made_of).encode()).hexdigest()[:24]}.npz"

    def rows(self, job: Job) -> list[NetworkRow]:
        """Return the errors of a job whose networks are all trained."""
        table = self.tables[job.pose]
        estimates, truths = [], []
        converged = 0
        for fold, mask in enumerate(self.masks(job)):
            rows = table[job.inputs][mask] if job.way != "staged" else np.empty((0, 0))
            if job.way == "staged":
                first, second = job.stages
                torque = _kept(self.path(first, fold))[0](table[first.inputs][mask])
                rows = table[second.inputs][mask]
                rows[:, second.inputs.index(PROXIMAL)] = torque[:, 0]
                network, done = _kept(self.path(second, fold))
            else:
                network, done = _kept(self.path(job, fold))
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


def train_task(task: Task) -> None:
    """Train one network and keep it."""
    table = mapped(Path(task.train), task.columns)
    job = task.job
    trained = train(
        table[job.inputs][task.rows],
        table[job.targets][task.rows],
        (job.inputs, job.targets),
        task.settings,
    )
    arrays = {"converged": np.array(trained.converged), **net.to_arrays(trained.network)}
    net.write_arrays(Path(task.path), SCHEMA, arrays)


def _kept(path: Path) -> tuple[Network, int]:
    arrays = net.read_arrays(path, SCHEMA)
    return net.from_arrays(arrays), int(arrays["converged"])


def run_networks(
    tables: dict[str, ClosingTable],
    state: Path,
    *,
    settings: Settings | None = None,
    every: int = 8,
    seed: int = 0,
    workers: int = 1,
    minutes: float = float("inf"),
    notes: tuple[str, ...] = (),
    on_network: Callable[[int, int], None] = lambda done, total: None,
) -> NetworkStudy:
    """Train what is not trained yet, and score all that is.

    Args:
        tables: Closing samples by pose.
        state: Folder of the trained networks.
        settings: Settings of the training; nodes and seed are the study's.
        every: Train on every n-th closing sample of the neutral pose, and on as many of others.
        seed: Seed of splits and of first weights.
        workers: Processes; each trains on one core.
        minutes: No network is started after this time.
        notes: Remarks for the reader.
        on_network: Called with the number of networks trained and their total.

    Raises:
        MissingExtraError: torch is missing.
        NetworkError: A kept network is damaged.
    """
    require_torch()
    settings = settings or Settings()
    trainer = Trainer(tables, state, settings, every, seed)
    planned = [job for job in jobs(tuple(tables)) if trainer.masks(job)]
    waiting = {task.path: task for job in planned for task in trainer.tasks(job)}
    _train_all(list(waiting.values()), workers, time.monotonic() + 60 * minutes, on_network)
    rows: list[NetworkRow] = []
    not_run = []
    for job in planned:
        if any(trainer.tasks(job)):
            not_run.append(job)
        else:
            rows += trainer.rows(job)
    neutral = tables["neutral"]
    return NetworkStudy(
        schema="rig.study.oneill-networks/1",
        rows=tuple(rows),
        not_run=tuple(not_run),
        samples={pose: len(table.run) for pose, table in tables.items()},
        peak_torque_n_m=float(np.max(_column(neutral, DISTAL))),
        every={pose: trainer.step(pose) for pose in tables},
        settings=settings,
        notes=notes,
        provenance=Provenance.now(seed),
    )


def _column(table: ClosingTable, name: str) -> FloatArray:
    return table[[name]][:, 0]


def _train_all(
    tasks: list[Task], workers: int, until_s: float, on_network: Callable[[int, int], None]
) -> None:
    """Train in processes of their own, so that each keeps to one core and can be stopped."""
    if not tasks:
        return
    queue = iter(tasks)
    done = 0
    on_network(0, len(tasks))
    # torch's threads do not survive a fork
    with ProcessPoolExecutor(workers, get_context("spawn"), _begin_worker) as pool:
        running: set[Future[None]] = set()
        try:
            while True:
                while len(running) < workers and time.monotonic() < until_s:
                    task = next(queue, None)
                    if task is None:
                        break
                    running.add(pool.submit(train_task, task))
                if not running:
                    return
                finished, running = wait(running, return_when=FIRST_COMPLETED)
                for future in finished:
                    future.result()
                done += len(finished)
                on_network(done, len(tasks))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _begin_worker() -> None:
    import torch

    torch.set_num_threads(1)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End when the study was killed, which closes no pool."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
