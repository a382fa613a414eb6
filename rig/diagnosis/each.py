"""Work on each of many folders, here, in processes or on a cluster; a lost process loses nothing.

A result is handed on as it comes, so an interrupted call has all that was done. When a process of
the pool is lost, only what it was working on is done again.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, as_completed
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TypeVar

ATTEMPTS = 4
"""Pools that are started before a folder that ends them is given up."""

Start = Callable[[], AbstractContextManager[Executor | None]]
T = TypeVar("T")


def for_each(
    folders: Sequence[Path],
    work: Callable[[Path], T],
    start: Start,
    on_done: Callable[[Path, T], None],
) -> None:
    """Do the work on each folder.

    Args:
        folders: The folders.
        work: What is done with one; it can be pickled.
        start: Starts what the work is given to: processes, a cluster, or None for this process.
        on_done: Called in this process with each folder and its result.

    Raises:
        BrokenExecutor: Processes end again and again.
    """
    missing = list(folders)
    for attempt in range(1, ATTEMPTS + 1):
        if not missing:
            return
        try:
            with start() as executor:
                for folder, result in _done(tuple(missing), work, executor):
                    on_done(folder, result)
                    missing.remove(folder)
        except BrokenExecutor:
            if attempt == ATTEMPTS:
                raise


def _done(
    folders: Sequence[Path], work: Callable[[Path], T], executor: Executor | None
) -> Iterator[tuple[Path, T]]:
    if executor is None:
        yield from ((folder, work(folder)) for folder in folders)
        return
    running = {executor.submit(work, folder): folder for folder in folders}
    for future in as_completed(running):
        yield running[future], future.result()
