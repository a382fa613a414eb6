"""Errors of runs without and with a cause, with the means of the runs left in or removed."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Errors:
    """Squared errors of runs.

    Attributes:
        centred: Run to the sum of squares, its mean removed.
        raw: The same with the mean left in.
        samples: Run to its samples.
    """

    centred: Mapping[str, float]
    raw: Mapping[str, float]
    samples: Mapping[str, int]

    @property
    def rmse(self) -> float:
        """Root mean square over all samples, each run's mean removed."""
        return _rms(self.centred, self.samples)

    @property
    def rmse_with_means(self) -> float:
        """Root mean square over all samples."""
        return _rms(self.raw, self.samples)

    @property
    def by_run(self) -> dict[str, float]:
        """Root mean square of each run, its mean removed."""
        return {n: float(np.sqrt(x / self.samples[n])) for n, x in self.centred.items()}

    def with_means(self) -> "Errors":
        """Return the errors that count where runs have no offsets of their own."""
        return replace(self, centred=self.raw)


def that_falls(
    before: Errors, after: Errors, with_means: bool, least: float
) -> tuple[Errors, Errors, bool]:
    """Return errors without and with a cause, of the kind by which it is confirmed.

    That is the kind stated, with the means of runs left in or removed, or the other one where the
    logarithm of that stated falls by less than `least`. Also whether the means are left in.
    """
    kinds = {False: (before, after), True: (before.with_means(), after.with_means())}
    old, new = kinds[with_means]
    if new.rmse > old.rmse * np.exp(-least):
        with_means = not with_means
    return *kinds[with_means], with_means


def _rms(squares: Mapping[str, float], samples: Mapping[str, int]) -> float:
    return float(np.sqrt(sum(squares.values()) / max(1, sum(samples.values()))))
