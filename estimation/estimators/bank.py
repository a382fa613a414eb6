"""Products of physical states as an estimator, with an interval and a range of validity."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.bank.beyond import coordinates
from estimation.bank.edges import only_levels, other_levels
from estimation.bank.fitting import Pool, Settings, chosen, solve
from estimation.bank.interval import Interval
from estimation.bank.states import Bank
from estimation.campaign import Campaign
from estimation.closing import is_closing, processed
from estimation.derived import zero_phase_channels
from estimation.estimator import Stepper, rows_of
from estimation.estimators.instrument import instrument_of, only_one, require_own
from estimation.estimators.origin import Origin
from estimation.estimators.run_evidence import (
    INNER_FOLDS,
    RunEvidence,
    interval_of,
    ranges_of,
    within_ranges,
)
from estimation.filters import PAPER, LowPass
from estimation.live_channels import CausalChannels, causal_channels
from estimation.networks.network import NetworkError, read_arrays, write_arrays
from estimation.recording import FloatArray, Recording, read_only

EVERY = 4
"""Of samples filtered at 50 Hz and taken at 1 kHz, every fourth one holds all there is to learn."""


@dataclass(frozen=True, eq=False)
class Estimates:
    """Estimates with what is known about their error, each of shape (n,)."""

    value: FloatArray  # the estimate, in the target's unit
    # half the width of the interval that covers 95 %; NaN where unknown: far from the fitted
    # conditions, opening, at rest, on another instrument, or in a recording that states another
    # level of a condition than the only one fitted
    half_width: FloatArray
    # whether position, load, speed and acceleration lie in the range fitted on
    inside: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class BankEstimator:
    """A fitted sum of products of physical states."""

    SCHEMA: ClassVar[str] = "rig.bank/4"

    bank: Bank
    target: str
    weights: FloatArray  # weight of each product, shape (size,)
    interval: Interval | None  # the error's interval; None where too few runs were fitted
    # lowest and highest value of each judged channel fitted on, shape (2, judged)
    ranges: FloatArray
    scale: FloatArray  # spread of each product over the samples fitted on, shape (size,)
    # instrument it was fitted on; empty where it is not known, or does not matter
    instrument: str = ""
    low_pass: LowPass = PAPER
    origin: Origin | None = None
    # level of each condition that all runs fitted on had alike
    only: Mapping[str, float] = field(default_factory=dict)
    # whether it is used on instruments it was not fitted on: nothing is in its range
    of_any: bool = False

    def __post_init__(self) -> None:
        for name, shape in {
            "weights": (self.bank.size,),
            "scale": (self.bank.size,),
            "ranges": (2, self.bank.judged),
        }.items():
            values = read_only(getattr(self, name))
            if values.shape != shape or np.isnan(values).any():
                raise NetworkError(
                    f"The {name} of a state estimator have shape {values.shape} or holds NaN.",
                    f"They must be {shape} and numbers.",
                )
            object.__setattr__(self, name, values)

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels that are read, measured or derived."""
        return self.bank.channels

    def predict(self, recording: Recording, causal: bool = False) -> FloatArray:
        """Return the value of `estimate` for each sample, shape (n,)."""
        return self.estimate(recording, causal).value

    def estimate(self, recording: Recording, causal: bool = False) -> Estimates:
        """Return the estimate for each sample with its interval and its validity.

        Raises:
            InstrumentError: The recording is of another instrument.
            MissingChannelError: The recording lacks a channel.
            FilterError: The run cannot be filtered.
        """
        require_own(self.instrument, recording)
        if causal:
            channels = causal_channels(recording, self.channels, self.low_pass, tracked=True)
        else:
            channels = zero_phase_channels(recording, self.channels, self.low_pass)
        return self.at(recording.conditions).of_rows(rows_of(channels, self.channels))

    def of_rows(self, rows: FloatArray) -> Estimates:
        """Return the estimates for rows of filtered channels, shape (n, channels)."""
        return self.of_design(self.bank.design(rows), rows)

    def of_design(self, design: FloatArray, rows: FloatArray) -> Estimates:
        """Return the estimates for a design of the bank and the rows it was made of."""
        design = within_ranges(self.bank, design, rows, self.ranges)
        width = np.full(len(rows), np.nan)
        if self.interval is not None:
            width = self.interval.half_width(design, coordinates(self.bank, rows))
        judged = rows[:, : self.bank.judged]
        within = (judged >= self.ranges[0]) & (judged <= self.ranges[1])
        inside = within.all(axis=1) & (not self.of_any)
        return Estimates(design @ self.weights, width, np.asarray(inside))

    def at(self, conditions: Mapping[str, float | str]) -> "BankEstimator":
        """Return the estimator for a run; one fitted at another single level has no interval."""
        return replace(self, interval=None) if other_levels(self.only, conditions) else self

    def for_any_instrument(self) -> "BankEstimator":
        """Return the estimator for use on instruments it was not fitted on.

        Nothing states how wrong it is there: it has no interval, and no sample is inside its range.
        """
        return replace(self, instrument="", interval=None, of_any=True)

    def stepper(self, sample_rate_hz: float) -> "BankStepper":
        """Return the estimator as it runs live."""
        return BankStepper(self, sample_rate_hz)

    def save(self, path: Path) -> None:
        """Write the estimator as NPZ."""
        interval = {} if self.interval is None else self.interval.arrays()
        origin = {} if self.origin is None else self.origin.arrays()
        write_arrays(
            path,
            self.SCHEMA,
            {
                "surrogate": np.array(self.bank.surrogate),
                "pose": np.array(self.bank.pose),
                "without": np.array(self.bank.without, dtype=np.str_),
                "target": np.array(self.target),
                "instrument": np.array(self.instrument),
                "weights": self.weights,
                "ranges": self.ranges,
                "scale": self.scale,
                "low_pass": np.array([self.low_pass.cutoff_hz, float(self.low_pass.order)]),
                "only": np.array(json.dumps(dict(self.only))),
                **interval,
                **origin,
            },
        )

    @classmethod
    def load(cls, path: Path) -> "BankEstimator":
        """Read what `save` wrote; nothing in the file is executed.

        Raises:
            NetworkError: The file is missing, damaged, or of another layout.
        """
        arrays = read_arrays(path, cls.SCHEMA)
        try:
            bank = Bank(
                str(arrays["surrogate"]),
                str(arrays["pose"]),
                tuple(str(name) for name in arrays["without"]),
            )
            cutoff_hz, order = arrays["low_pass"].tolist()
            return cls(
                bank,
                str(arrays["target"]),
                arrays["weights"],
                Interval.from_arrays(arrays),
                arrays["ranges"],
                arrays["scale"],
                str(arrays["instrument"]),
                LowPass(cutoff_hz, int(order)),
                Origin.from_arrays(arrays),
                json.loads(str(arrays.get("only", "{}"))),
            )
        except (KeyError, ValueError) as error:
            raise NetworkError(f"The file {path} holds no state estimator.", str(error)) from error


class BankStepper(Stepper):
    """A state estimator as it runs live; its interval differs from sample to sample."""

    def __init__(self, estimator: BankEstimator, sample_rate_hz: float) -> None:
        names, low_pass = estimator.channels, estimator.low_pass
        super().__init__(CausalChannels(names, sample_rate_hz, low_pass, tracked=True))
        self.inside = np.empty(0, np.bool_)
        self._estimator = estimator

    def step(self, time_s: ArrayLike, measured: Mapping[str, ArrayLike]) -> FloatArray:
        """Take the next samples and return their estimates, shape (n,); NaN where one is lost."""
        channels = self._source.step(time_s, measured)
        found = self._estimator.of_rows(rows_of(channels, self._estimator.channels))
        self.inside, newest = found.inside, found.half_width[-1:]
        self.half_width = float(newest[0]) if np.isfinite(newest).any() else None
        return found.value


def fit_runs(runs: Sequence[RunEvidence], bank: Bank, target: str) -> BankEstimator:
    """Fit weights and, from runs left out in turn, how they are found and the interval.

    The runs were reduced with the bank; the target is the channel that is estimated.

    Raises:
        NetworkError: The campaign is empty.
    """
    if not runs:
        raise NetworkError("No closing samples to fit a state estimator on.")
    whole = Pool.of([run.normal for run in runs])
    settings, interval = Settings(), None
    if len(runs) >= INNER_FOLDS:
        folds = [Pool.of([r.normal for r in runs[k::INNER_FOLDS]]) for k in range(INNER_FOLDS)]
        settings = chosen(whole, folds, bank.shape)
        interval = interval_of(runs, whole, bank, settings)
    weights = solve(whole, bank.shape, settings)[:, 0]
    return BankEstimator(
        bank,
        target,
        weights,
        interval,
        ranges_of([run.ranges for run in runs]),
        whole.spread,
        only=only_levels([run.conditions for run in runs]),
    )


@dataclass(frozen=True)
class BankRecipe:
    """Fits a state estimator of a target on the closing samples of a campaign."""

    target: str
    bank: Bank = field(default_factory=Bank)
    # fit on channels filtered as live, for use as live; the target has no lag anyway
    causal: bool = False
    low_pass: LowPass = PAPER

    def fit(self, campaign: Campaign) -> BankEstimator:
        """Fit on the valid closing samples of the runs that are not excluded.

        Raises:
            NetworkError: The campaign has no closing samples.
            MissingChannelError: A run lacks a channel.
        """
        runs, instruments = [], set()
        for recording in campaign.evidence:
            run = self.evidence_of(recording)
            if run is not None:
                runs.append(run)
            instruments.add(instrument_of(recording))
        fitted = fit_runs(runs, self.bank, self.target)
        return replace(fitted, instrument=only_one(instruments), low_pass=self.low_pass)

    def evidence_of(self, recording: Recording) -> RunEvidence | None:
        """Reduce a raw run; None where it has no valid closing sample.

        Which samples close, and the target, are always taken without lag.

        Raises:
            MissingChannelError: The run lacks a channel.
        """
        bank = self.bank
        run = processed(recording, [*bank.channels, self.target], self.low_pass)
        kept = np.flatnonzero(is_closing(run) & run.valid)[::EVERY]
        if not len(kept):
            return None
        source = run
        if self.causal:
            source = causal_channels(recording, bank.channels, self.low_pass, tracked=True)
        truths = run[self.target][kept, None]
        rows = rows_of(source, bank.channels)[kept]
        (evidence,) = RunEvidence.of_rows(bank, rows, truths, recording.conditions)
        return evidence
