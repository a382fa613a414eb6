"""A benchmark's result: how many times better than a stated baseline, in the same run."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter


@dataclass(frozen=True)
class Ratio:
    """One ratio and the target it is held against."""

    name: str
    ratio: float
    target: float
    higher_is_better: bool = True
    detail: str = ""


def best_of(function: Callable[[], object], repeats: int = 3) -> float:
    """Return the shortest of several runs, in seconds."""
    times = []
    for _ in range(repeats):
        start = perf_counter()
        function()
        times.append(perf_counter() - start)
    return min(times)
