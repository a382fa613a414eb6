"""Seeds of a simulated study, each kept as it is done.

An outcome is kept under a name made of the seed and of the source that makes it, so a study that
was interrupted goes on where it stopped and never mixes in what other source made.
"""

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread
from typing import TypeVar

from pydantic import TypeAdapter

from estimation.files import write_text_atomic

T = TypeVar("T")
Task = TypeVar("Task")


@dataclass(frozen=True)
class Keeper:
    """Where the outcomes of a study are kept, and how they are made."""

    state: Path
    workers: int = 1  # processes; each does one seed at a time
    # called after each seed, also after one that was kept
    on_seed: Callable[[], None] = lambda: None


def kept_outcomes(
    kind: type[T],
    one_seed: Callable[[int], T],
    seeds: int,
    schema: str,
    keeper: Keeper,
    start: Callable[[], None] | None = None,
) -> list[T]:
    """Do seeds from 0 that are not kept yet, and return the outcomes of all in order.

    An outcome is what JSON can hold, in tuples, dictionaries and dataclasses; the schema names the
    study's layout. `start` is called first in each process; None with one worker works in this one.

    Raises:
        OSError: The folder cannot be written.
    """
    source, json_of = source_digest(schema), TypeAdapter(kind)
    places = {seed: keeper.state / f"{source}-{seed}.json" for seed in range(seeds)}
    outcomes: dict[int, T] = {}
    for seed, place in places.items():
        try:
            outcomes[seed] = json_of.validate_python(json.loads(place.read_text()))
        except (OSError, ValueError):
            place.unlink(missing_ok=True)  # damaged: it is made again
            continue
        keeper.on_seed()
    missing = [seed for seed in places if seed not in outcomes]
    alone = keeper.workers == 1 and start is None
    made = (
        ((seed, one_seed(seed)) for seed in missing)
        if alone
        else in_processes(one_seed, missing, keeper.workers, start)
    )
    for seed, outcome in made:
        write_text_atomic(places[seed], json.dumps(json_of.dump_python(outcome)))
        outcomes[seed] = outcome
        keeper.on_seed()
    return [outcomes[seed] for seed in range(seeds)]


def source_digest(schema: str) -> str:
    """Return a name for the source that outcomes come from; pages only show them."""
    root = Path(__file__).parents[2]
    rooms = ("simulation", "arm", "grasper", "studies")
    parts = [root / "estimation", *(root / "rig" / room for room in rooms)]
    digest = hashlib.sha256(schema.encode())
    for path in sorted(path for part in parts for path in part.rglob("*.py")):
        if not path.stem.endswith("page"):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def in_processes(
    one: Callable[[Task], T],
    tasks: Iterable[Task],
    workers: int,
    start: Callable[[], None] | None = None,
    goes_on: Callable[[], bool] = lambda: True,
) -> Iterator[tuple[Task, T]]:
    """Yield tasks with their results as they are done, each worker on one at a time.

    `start` is called first in each process. When `goes_on` denies it no further task begins, and
    those at work end.
    """
    queue = iter(tasks)
    running: dict[Future[T], Task] = {}
    # threads, such as a learning library's, do not survive a fork
    with ProcessPoolExecutor(workers, get_context("spawn"), start) as pool:
        try:
            while True:
                while len(running) < workers and goes_on():
                    task = next(queue, None)
                    if task is None:
                        break
                    running[pool.submit(one, task)] = task
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def begin_learning() -> None:
    """Keep this process' torch to one core, and end when the study was killed."""
    import torch

    torch.set_num_threads(1)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()  # one that is killed closes no pool
    if parent is not None:
        parent.join()
        os._exit(1)
