"""Measured and estimated signals of the runs, with the declared model and with the findings.

A page draws them. They follow from recordings and two fitted models an equation, whatever method
found the difference between the two.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.derived import settled_places, zero_phase_channels
from estimation.diagnosis.split import Sealed
from estimation.model import Model, Term, estimate
from estimation.recording import FloatArray, Recording


@dataclass(frozen=True)
class RunTrace:
    """One run in one equation.

    Attributes:
        run: Name of the run.
        held_out: Whether it is a held-out test run.
        time_s: Time since the run began, shape (n,), s.
        measured: The target, zero-phase filtered, shape (n,).
        before: Estimate of the declared model, with this run's mean error added, shape (n,).
        after: The same of the model with the findings.
        counted: Samples that fits and errors are over, shape (n,).
        channels: Channels that the findings read, shape (n,) each.
    """

    run: str
    held_out: bool
    time_s: FloatArray
    measured: FloatArray
    before: FloatArray
    after: FloatArray
    counted: NDArray[np.bool_]
    channels: Mapping[str, FloatArray]


@dataclass(frozen=True)
class EquationTraces:
    """All runs in one equation.

    Attributes:
        before: The declared model, fitted.
        after: The model with the findings.
        runs: The runs, in the order of the campaign.
    """

    before: Model
    after: Model
    runs: tuple[RunTrace, ...]

    @property
    def held_out(self) -> tuple[RunTrace, ...]:
        """The held-out test runs."""
        return tuple(run for run in self.runs if run.held_out)

    @property
    def added(self) -> tuple[Term, ...]:
        """The terms that only the model with the findings has."""
        declared = [(t.effect.id, dict(t.channels)) for t in self.before.terms]
        return tuple(t for t in self.after.terms if (t.effect.id, dict(t.channels)) not in declared)


def traces(
    recordings: Sequence[Recording], sealed: Sealed, before: Model, after: Model
) -> EquationTraces:
    """Return the traces of one equation.

    Args:
        recordings: All runs.
        sealed: Which of them are held-out test runs.
        before: The declared model, fitted.
        after: The model with the findings, fitted.

    Raises:
        NotFittedError: A parameter has no value.
        MissingChannelError: A recording lacks a channel.
        FilterError: A run cannot be filtered.
    """
    found = EquationTraces(before, after, ())
    read = [c for term in found.added for c in term.channels.values()]
    runs = (_run(r, r.name in sealed.confirm, found, read) for r in recordings)
    return EquationTraces(before, after, tuple(run for run in runs if run is not None))


def _run(
    recording: Recording, held_out: bool, models: EquationTraces, read: Sequence[str]
) -> RunTrace | None:
    before, after = models.before, models.after
    speeds = [c for c in before.channels if c.endswith(("_velocity_rad_s", "_velocity_m_s"))]
    names = [*before.channels, *after.channels, before.target, *read, *speeds]
    channels = zero_phase_channels(recording, names, before.low_pass)
    places = settled_places(channels, before.low_pass, samples=before.samples)
    if not len(places):
        return None
    counted = np.zeros(len(channels), bool)
    counted[places] = True
    measured = channels[before.target]
    estimates = []
    for model in (before, after):
        values = estimate(model, channels)
        estimates.append(values + (measured - values)[counted].mean())
    return RunTrace(
        recording.name,
        held_out,
        channels.time_s - channels.time_s[0],
        measured,
        estimates[0],
        estimates[1],
        counted,
        {name: channels[name] for name in dict.fromkeys(read)},
    )
