"""Where experiments are played: here, in processes of this machine, or on a Dask cluster.

The diagnosis itself knows only `concurrent.futures.Executor`.
"""

from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any

from rig.errors import MissingExtraError, UsageError

CONNECT_S = 20.0
RETRIES = 3
"""Times a task is restarted when its worker is lost."""


@contextmanager
def engine(workers: int = 1, scheduler: str | None = None) -> Iterator[Executor | None]:
    """Yield what work is given to, or None for this process.

    Args:
        workers: Processes of this machine; 1 is this one.
        scheduler: Address of a Dask scheduler, such as `tcp://host:8786`; goes before `workers`.
            Its workers need the same version of rig.

    Raises:
        UsageError: The number of workers is impossible, the extra is not installed, or no
            scheduler answers.
    """
    if workers < 1:
        raise UsageError(f"--workers is {workers}; it is 1 or more.")
    if scheduler is not None:
        with _cluster(scheduler) as executor:
            yield executor
    elif workers > 1:
        with ProcessPoolExecutor(workers) as pool:
            yield pool
    else:
        yield None


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
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
        client = connect(address, timeout=CONNECT_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise UsageError(
            f"No scheduler answers at {address}.",
            str(error),
            "Start one with `dask scheduler`, and workers with `dask worker ADDRESS`.",
        ) from error
    with client, client.get_executor(pure=False, retries=RETRIES) as executor:
        yield executor
