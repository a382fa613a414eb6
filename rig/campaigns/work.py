"""Where work is done: here, in processes of this machine, or on a Dask cluster.

The work itself knows only `concurrent.futures.Executor`. Of work on many folders each result is
handed on as it comes, so an interrupted call has all that was done; when a process of the pool is
lost, only what it was working on is done again.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, as_completed
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, TypeVar

from rig.errors import MissingExtraError, UsageError

Start = Callable[[], AbstractContextManager[Executor | None]]
"""Starts what work is given to: processes, a cluster, or None for this process."""

ATTEMPTS = 4
"""Pools that are started before a folder that ends them is given up."""

T = TypeVar("T")


@contextmanager
def engine(
    workers: int = 1, scheduler: str | None = None, connect_s: float = 20.0
) -> Iterator[Executor | None]:
    """Yield what work is given to: processes of this machine, or None for this one (1).

    The address of a Dask scheduler, such as `tcp://host:8786`, goes before that. It is waited for
    `connect_s`; its workers need the same version of rig.

    Raises:
        UsageError: The number of workers is impossible, the extra is not installed, or no
            scheduler answers.
    """
    if workers < 1:
        raise UsageError(f"--workers is {workers}; it is 1 or more.")
    if scheduler is not None:
        with _cluster(scheduler, connect_s) as executor:
            yield executor
    elif workers > 1:
        with ProcessPoolExecutor(workers) as pool:
            yield pool
    else:
        yield None


@contextmanager
def _cluster(address: str, connect_s: float) -> Iterator[Executor]:
    try:
        import distributed
    except ImportError as error:
        raise MissingExtraError(
            "A cluster needs the library distributed, which is not installed.",
            "Most diagnoses run on one machine.",
            "cluster",
        ) from error
    try:
        connect: Any = distributed.Client
        client = connect(address, timeout=connect_s)
    except (OSError, ValueError, TimeoutError) as error:
        raise UsageError(
            f"No scheduler answers at {address}.",
            str(error),
            "Start one with `dask scheduler`, and workers with `dask worker ADDRESS`.",
        ) from error
    # a task is restarted when its worker is lost
    with client, client.get_executor(pure=False, retries=3) as executor:
        yield executor


def for_each(
    folders: Sequence[Path],
    kept: Callable[[Path], T | None],
    work: Callable[[Path], T],
    start: Start,
    on_done: Callable[[Path, T], None],
) -> dict[Path, T]:
    """Do the work, which can be pickled, on each folder that has no kept result.

    `on_done` is called in this process with each folder and its result. All results are returned.

    Raises:
        BrokenExecutor: Processes end again and again.
    """
    found = {folder: one for folder in folders if (one := kept(folder)) is not None}
    for attempt in range(ATTEMPTS):
        missing = [folder for folder in folders if folder not in found]
        if not missing:
            break
        try:
            with start() as executor:
                for folder, result in _done(missing, work, executor):
                    on_done(folder, result)
                    found[folder] = result
        except BrokenExecutor:
            if attempt == ATTEMPTS - 1:
                raise
    return {folder: found[folder] for folder in folders}


def _done(
    folders: Sequence[Path], work: Callable[[Path], T], executor: Executor | None
) -> Iterator[tuple[Path, T]]:
    if executor is None:
        yield from ((folder, work(folder)) for folder in folders)
        return
    running = {executor.submit(work, folder): folder for folder in folders}
    for future in as_completed(running):
        yield running[future], future.result()
