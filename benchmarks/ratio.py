"""A measured ratio against a named baseline, and the timing both sides share."""

import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Ratio:
    """One line of the benchmark table.

    Attributes:
        name: What was measured, against which baseline.
        target: What it should reach.
        higher_is_better: Whether the target is a floor (True) or a ceiling.
    """

    name: str
    ratio: float
    target: float
    higher_is_better: bool = True
    detail: str = ""

    @property
    def holds(self) -> bool:
        """Whether the target is reached."""
        return self.ratio >= self.target if self.higher_is_better else self.ratio <= self.target


def best_of(function: Callable[[], object], repeats: int = 3) -> float:
    """Return the shortest of several timings of a call, s; the shortest is the least disturbed."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)
