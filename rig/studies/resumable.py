"""Many like tasks in several processes, each result kept as soon as it is there."""

import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any, Protocol, TypeVar

from estimation.files import write_text_atomic


class Task(Protocol):
    """What is done, plain data that travels to other processes."""

    @property
    def file(self) -> str:
        """Name of its result; the same task has the same name, another one another."""
        ...


T = TypeVar("T", bound=Task)
R = TypeVar("R")


def results(
    tasks: Sequence[T],
    work: Callable[[T], R],
    to_json: Callable[[R], Any],
    from_json: Callable[[Any], R],
    *,
    workers: int = 1,
    keep: Path | None = None,
) -> Iterator[tuple[T, R]]:
    """Yield each task with its result as it is there, those that are kept first.

    Args:
        tasks: The tasks.
        work: Does one; a function of a module, since processes find it by its name.
        to_json: Result to plain JSON types.
        from_json: The way back.
        workers: Processes at once; 1 is this one.
        keep: Folder of the results; nothing is kept without one.
    """
    todo = []
    for task in tasks:
        kept = keep / task.file if keep is not None else None
        if kept is not None and kept.is_file():
            yield task, from_json(json.loads(kept.read_text()))
        else:
            todo.append(task)
    for task, result in _done(todo, work, workers):
        if keep is not None:
            keep.mkdir(parents=True, exist_ok=True)
            text = json.dumps(to_json(result), allow_nan=False)
            write_text_atomic(keep / task.file, text + "\n")
        yield task, result


def _done(tasks: Sequence[T], work: Callable[[T], R], workers: int) -> Iterator[tuple[T, R]]:
    if workers == 1:
        yield from ((task, work(task)) for task in tasks)
        return
    with ProcessPoolExecutor(workers) as pool:
        jobs = {pool.submit(work, task): task for task in tasks}
        for job in as_completed(jobs):
            yield jobs[job], job.result()
