"""The loop on the simulated rig: record, diagnose, take the next experiment, record again.

Each round's runs lie in their own folder, and each diagnosis reads all rounds. The ledger knows the
runs of earlier rounds, so that only new runs confirm.
"""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from estimation.causes.verdict import Answer
from estimation.diagnosis.result import Diagnosis
from estimation.files import write_text_atomic
from estimation.model import Model
from rig.bench.logger import open_logger
from rig.bench.session import Session
from rig.configuration.config import Config
from rig.diagnosis.ledger import Ledger
from rig.diagnosis.run import run_diagnosis
from rig.diagnosis.subject import Subject
from rig.errors import UsageError
from rig.importers.registry import open_campaign
from rig.protocols.protocol import Protocol, load_protocol, protocol_toml
from rig.recording.campaign import Progress, open_campaign_folder, record_campaign

UNIQUE = "every name is unique"
NOTHING = "nothing is missing above the floor"
NO_RIVALS = "no experiment of the menu separates the alternatives"
SPENT = "the budget is spent"


@dataclass(frozen=True)
class Budget:
    """What a loop may use: so many rounds, and minutes after which no further one begins."""

    rounds: int
    minutes: float

    def __post_init__(self) -> None:
        if self.rounds < 1 or not self.minutes > 0:
            raise UsageError(
                f"A budget of {self.rounds} rounds and {self.minutes:g} minutes allows nothing.",
                fix="Give one round and some minutes at least.",
            )


@dataclass(frozen=True)
class Round:
    """One round.

    Attributes:
        number: From 1.
        experiment: Name of the protocol that was recorded.
        folder: Its logs.
        runs: Runs recorded in it.
        done: The diagnosis of all rounds so far.
        stopped: Why the loop ends here; empty when it goes on.
    """

    number: int
    experiment: str
    folder: Path
    runs: int
    done: Answer
    stopped: str

    def to_json(self) -> dict[str, Any]:
        """Return the round in plain JSON types."""
        return {
            "round": self.number,
            "experiment": self.experiment,
            "folder": str(self.folder),
            "runs": self.runs,
            "stopped": self.stopped or None,
            "diagnosis": self.done.diagnosis.to_json(),
        }


def run_loop(
    folder: Path,
    config: Config,
    models: list[Model],
    budget: Budget,
    *,
    first: Protocol | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    quick: bool = False,
    on_stage: Callable[[str], None] = lambda _: None,
    on_progress: Progress | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[Round]:
    """Yield rounds until every name is unique, nothing is left, or the budget is spent.

    Rounds, their protocols and the ledger go into the folder, which is empty or absent. The first
    experiment is the shipped protocol `diagnosis` when None. Seed, executor, `quick` and `on_stage`
    are those of `run_diagnosis`; each round's sensor noise has a seed of its own. `on_progress` is
    called with the samples as they are recorded.

    Raises:
        UsageError: The rig is not simulated, or the folder is not empty.
        EstimationError: A round cannot be diagnosed.
    """
    if not config.is_simulated:
        raise UsageError(
            f"{config.name} is a real rig, and the loop moves a simulated one.",
            "Nobody would stand by while it chooses its own experiments.",
            "Use `rig diagnose --protocol-out FILE`, then `rig record --protocol FILE`.",
        )
    if folder.exists() and any(folder.iterdir()):
        raise UsageError(f"{folder} is not empty.", fix="Name another folder with --out.")
    began = clock()
    protocol = first or load_protocol("diagnosis")
    ledger = Ledger(folder / "looks.jsonl")
    for number in range(1, budget.rounds + 1):
        place = folder / "runs" / f"round-{number}"
        on_stage(f"round {number}: recording {protocol.name!r}")
        runs = _record(_with_noise_of(config, number), protocol, place, on_progress)
        write_text_atomic(folder / f"round-{number}.protocol.toml", protocol_toml(protocol))
        done, look = run_diagnosis(
            Subject(open_campaign(folder / "runs"), models),
            ledger,
            seed=seed,
            executor=executor,
            quick=quick,
            on_stage=lambda what, n=number: on_stage(f"round {n}: {what}"),  # type: ignore[misc]
        )
        ledger.enter(look)
        spent = number == budget.rounds or clock() - began > 60.0 * budget.minutes
        stopped = _settled(done.diagnosis) or (SPENT if spent else "")
        yield Round(number, protocol.name, place, runs, done, stopped)
        proposed = done.diagnosis.next_experiment
        if stopped or proposed is None:
            return
        protocol = Protocol.model_validate(proposed["protocol"])


def _settled(diagnosis: Diagnosis) -> str:
    """Return why no further round is needed or possible; empty when one is."""
    if not diagnosis.findings:
        return NOTHING
    if all(f.verdict == "identified" for f in diagnosis.findings):
        return UNIQUE
    proposed = diagnosis.next_experiment
    return "" if proposed is not None and proposed["protocol"] is not None else NO_RIVALS


def _with_noise_of(config: Config, number: int) -> Config:
    """Return the same rig with other noise; where the seed also draws the rig it stays."""
    if config.simulation.spread:
        return config
    return config.changed(simulation={"seed": config.simulation.seed + 1000 * (number - 1)})


def _record(config: Config, protocol: Protocol, folder: Path, on_progress: Progress | None) -> int:
    plans = open_campaign_folder(folder, protocol, config, resume=False)
    with Session(config, open_logger(config)) as session:
        results = record_campaign(session, plans, folder, on_progress=on_progress)
        return len(list(results))
