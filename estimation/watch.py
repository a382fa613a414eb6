"""The residual monitor: detects when a fitted model no longer fits the recordings.

The unit is the run. The logarithm of each run's error is compared with the error and the spread
over runs of the model's own fit. A one-sided cumulative sum adds the excess over half a spread
(Page, Biometrika 41, 1954), so that a small lasting change is detected like a large one, and a
single unusual run is not.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from estimation.model import Model, counted_error
from estimation.recording import Recording
from estimation.scores import rmse

T = TypeVar("T")

SLACK = 0.5
"""Spreads by which a run may be worse than usual without counting."""

LIMIT = 5.0
"""Sum at which the model no longer fits: with this slack a change is claimed by chance once in
some 900 runs (normal errors)."""

MOST = 4.0
"""A run counts as this many spreads at most, so that no single run decides."""

LEAST_SPREAD = 0.1
"""Runs that the model was not fitted on differ by a tenth at least."""

FIRST = 5
"""Runs that replace those of the fit where the model's file has no error."""


@dataclass(frozen=True, slots=True)
class Sight:
    """The verdict of one run on the model."""

    name: str
    # its error, in the unit of the target, its mean removed where offsets are a nuisance
    rmse: float
    usual: float | None  # the error of the model's own fit; None while it is still being learnt
    statistic: float  # the cumulative sum, in spreads
    since: str | None  # first run that the model does not fit, or None while it fits

    @property
    def fits(self) -> bool:
        """Whether the model still fits."""
        return self.since is None


class ResidualWatch:
    """Evaluates runs in sequence and reports when a model no longer fits."""

    def __init__(self, model: Model, least_spread: float = LEAST_SPREAD) -> None:
        """Start before the first run of a fitted model.

        The least spread of the log error is more for pieces of runs than for runs.
        """
        self.model = model
        self._least_spread = least_spread
        self._learnt: list[float] = []
        self._sum = 0.0
        self._rising: list[tuple[str, float]] = []
        self._since: str | None = None

    def see(self, recording: Recording) -> Sight | None:
        """Take the next run; None where it has no sample that a fit would use.

        Raises:
            NotFittedError: A parameter has no value.
            MissingChannelError: The run lacks a channel of the model.
        """
        error = run_error(self.model, recording)
        if error is None or error <= 0.0:
            return None
        usual, spread = self._usual()
        if usual is None:
            self._learnt.append(error)
            return Sight(recording.name, error, None, 0.0, None)
        worse = min((math.log(error / usual)) / max(spread, self._least_spread), MOST)
        self._sum = max(0.0, self._sum + worse - SLACK)
        self._rising = [*self._rising, (recording.name, worse)] if self._sum > 0.0 else []
        if self._sum > LIMIT and self._since is None:
            self._since = begin_of(self._rising)
        return Sight(recording.name, error, usual, self._sum, self._since)

    def _usual(self) -> tuple[float | None, float]:
        """Return the error a run usually has and the spread of its logarithm."""
        evidence = self.model.evidence
        if evidence is not None:
            rmse = evidence.rmse if self.model.run_offsets else evidence.rmse_with_means
            return rmse, evidence.run_spread or 0.0
        if len(self._learnt) < FIRST:
            return None, 0.0
        logs = np.log(self._learnt)
        return float(np.exp(logs.mean())), float(logs.std(ddof=1))


def begin_of(rising: Sequence[tuple[T, float]]) -> T:
    """Return the one of a rising sum at which a step explains most of it, in least squares."""
    errors = np.array([worse for _, worse in rising])
    after = np.cumsum(errors[::-1])[::-1]
    lengths = np.arange(len(errors), 0, -1)
    gain = np.where(after > 0, after**2 / lengths, 0.0)
    return rising[int(np.argmax(gain))][0]


def run_error(model: Model, recording: Recording) -> float | None:
    """Return a model's error on one run as its fit counts it, or None without a usable sample."""
    error = counted_error(model, recording)
    if error.size == 0:
        return None
    return rmse(error, error.mean() if model.run_offsets else 0.0)
