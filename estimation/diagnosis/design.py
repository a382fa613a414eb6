"""Columns of a run on a common footing: one filter, the same instants, the mean removed.

Every raw channel goes through the model's zero-phase filter, and derivatives are made from it at
the full rate. Target and columns are then taken at the same instants, as many as the filter leaves
something to tell: a column without memory is worked out at these alone, one with memory over the
whole run. A regression needs no more than that both sides are seen at the same instants.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from estimation.derived import zero_phase_channels
from estimation.diagnosis.candidate import Candidate, Spans
from estimation.errors import EstimationError
from estimation.model import Model
from estimation.recording import FloatArray, Recording
from estimation.rest import SPEED, SPINDLE_SPEED, closing, in_motion

WITH_FRICTION = ("motor", "cable", "grasp")
"""Balances that friction stands in. At rest it takes whatever value holds the balance, so samples
at rest tell nothing of a model of motion: they are left out of search, fit and error."""

Mapper = Callable[..., Iterable[Any]]
"""`map`, or the `map` of a `concurrent.futures.Executor`."""


class DesignError(EstimationError):
    """A run has no samples to diagnose on."""


@dataclass(frozen=True)
class Run:
    """The filtered channels of one run, plain data that travels to other processes.

    Attributes:
        name: Name of the run.
        channels: Channel name to values at the full rate, shape (n,).
        valid: Samples without a flag and away from the ends, of those the model counts, shape (n,).
        moving: Samples that are not at rest, where friction is in the balance, shape (n,).
        down: One in so many samples is regressed on.
    """

    name: str
    channels: Mapping[str, FloatArray]
    valid: NDArray[np.bool_]
    moving: NDArray[np.bool_]
    down: int

    @property
    def used(self) -> NDArray[np.bool_]:
        """Samples at the full rate that fits and decisions count: valid, in motion, shape (n,)."""
        return self.valid & self.moving

    @cached_property
    def kept(self) -> NDArray[np.intp]:
        """Places of the samples that are regressed on: every `down`-th one that is used."""
        at = np.arange(0, len(self.valid), self.down)
        return at[self.used[at]]

    @cached_property
    def sampled(self) -> Mapping[str, FloatArray]:
        """The channels at these places, each of shape (n,)."""
        return {name: values[self.kept] for name, values in self.channels.items()}

    def thin(self, columns: FloatArray) -> FloatArray:
        """Return columns of shape (samples, k) at the places that are regressed on."""
        return np.asarray(columns[self.kept])

    def centred(self, columns: FloatArray) -> FloatArray:
        """Return the same with the mean removed."""
        thin = self.thin(columns)
        return np.asarray(thin - thin.mean(axis=0))


def prepare(recording: Recording, names: Iterable[str], model: Model) -> Run:
    """Filter one run's channels as a model says and mark what may be used of it.

    Raises:
        DesignError: No usable sample is left.
        MissingChannelError: The recording lacks a channel.
        FilterError: The run cannot be filtered.
    """
    low_pass = model.low_pass
    speeds = _friction_speeds(model, recording)
    wanted = list(dict.fromkeys([*names, *speeds]))
    filtered = zero_phase_channels(recording, wanted, low_pass, model.signals)
    rate_hz = recording.sample_rate_hz
    edge = int(np.ceil(2 * low_pass.reach_s * rate_hz))
    # the filter smears what is flagged as it smears the ends
    spoilt = ndimage.maximum_filter1d((~filtered.valid).astype(np.uint8), 2 * edge + 1)
    valid = spoilt == 0
    valid[:edge] = False
    valid[max(len(valid) - edge, 0) :] = False
    down = max(1, int(rate_hz / (2 * low_pass.cutoff_hz)))
    channels = {name: np.array(filtered[name]) for name in {*wanted, "time_s"}}
    channels["time_s"] = channels["time_s"] - channels["time_s"][0]
    moving = np.ones(len(valid), bool)
    if model.counted == "closing":
        valid &= closing(channels[SPINDLE_SPEED], rate_hz)  # the others are no part of the claim
    else:
        for speed in speeds:
            moving &= in_motion(channels[speed], valid, rate_hz, model.signals.rest.get(speed, 0.0))
    run = Run(recording.name, channels, valid, moving, down)
    if len(run.kept) < 20:
        raise DesignError(
            f"Run {recording.name!r} leaves {len(run.kept)} usable samples.",
            "The others are flagged or at rest, or too near to the ends or a flag for the filter.",
            "Record it anew, or exclude it.",
        )
    return run


def _friction_speeds(model: Model, recording: Recording) -> list[str]:
    """Return the speeds that tell which samples count; none where all do."""
    if model.counted == "closing":
        return [SPINDLE_SPEED]
    if model.counted == "all" or model.balance not in WITH_FRICTION:
        return []
    own = [channel for channel in model.channels if channel in model.signals.rest]
    return own or ([SPEED] if "motor_angle_rad" in recording else [])


def _run_columns(run: Run, wanted: Sequence[Candidate], means: bool) -> FloatArray:
    """Return the columns of candidates on one run, side by side, at its places."""
    whole = np.empty((len(run.kept), sum(len(c.effect.amplitudes) for c in wanted)))
    at = 0
    for candidate in wanted:
        columns = columns_at(run, candidate)
        whole[:, at : at + columns.shape[1]] = columns
        at += columns.shape[1]
    if means:
        whole -= whole.mean(axis=0)
    return whole


def columns_at(run: Run, candidate: Candidate) -> FloatArray:
    """Return a candidate's columns at the places of a run, shape (n, amplitudes)."""
    if candidate.effect.start():
        return run.thin(candidate.columns(run.channels))
    return candidate.columns(run.sampled)


def covered(wanted: Sequence[Candidate], runs: Sequence[Run]) -> list[Candidate]:
    """Return the candidates but those that the runs cannot show as what they are."""
    spans = spans_of(wanted, runs)
    return [c for c in wanted if c.shows(spans)]


def spans_of(wanted: Sequence[Candidate], runs: Sequence[Run]) -> Spans:
    """Return the widest range that a run covers of each role and channel that candidates read.

    Of a speed it is the median over the runs of the 95th percentile of its size, of the campaign's
    clock the campaign's length.
    """
    played = {part for c in wanted for part in c.channels}
    return {(role, channel): _span(channel, role, runs) for role, channel in played}


def _span(channel: str, role: str, runs: Sequence[Run]) -> float:
    if role == "speed":
        usual = [np.percentile(np.abs(run.channels[channel][run.valid]), 95) for run in runs]
        return float(np.median(usual))
    if role == "campaign_clock":
        return float(max(run.channels[channel].max() for run in runs))
    return float(max(np.ptp(run.channels[channel]) for run in runs))


def tables(
    runs: Sequence[Run], wanted: Sequence[Candidate], demean: bool, mapper: Mapper = map
) -> list[FloatArray]:
    """Return the candidates' columns of every run, one array of shape (n, columns) a run.

    Args:
        runs: The runs.
        wanted: The candidates.
        demean: Remove each run's mean.
        mapper: Maps over runs; an executor's makes it parallel.
    """
    if not wanted:
        return [np.empty((len(run.kept), 0)) for run in runs]
    count = len(runs)
    return list(mapper(_run_columns, runs, [list(wanted)] * count, [demean] * count))


def targets(runs: Sequence[Run], model: Model) -> list[FloatArray]:
    """Return the target at each run's places, shape (n,), its mean removed where that is due."""
    columns = [run.channels[model.target][:, None] for run in runs]
    if model.run_offsets:
        return [run.centred(c)[:, 0] for run, c in zip(runs, columns, strict=True)]
    return [run.thin(c)[:, 0] for run, c in zip(runs, columns, strict=True)]
