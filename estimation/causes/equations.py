"""The declared equations of a machine on its runs: fitted terms, columns, and which samples count.

Every channel goes through the zero-phase filter of the equations' models and is kept at a few times
its cutoff. Effects with memory are worked out on that series; everything is regressed on a coarser
grid that all equations of a run share.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from estimation.campaign import Campaign
from estimation.derived import (
    CAMPAIGN_TIME,
    CLOCKS,
    measured_channels,
    origin_of,
    zero_phase_channels,
)
from estimation.effects import Proportional
from estimation.errors import EstimationError
from estimation.filters import FilterError, LowPass
from estimation.fit_problem import OFFSET
from estimation.fitting import fit
from estimation.model import Model, Term, balance_channels
from estimation.noise import white_noise
from estimation.opposed import FIX, opposed
from estimation.predicted import with_prediction
from estimation.recording import FloatArray, Recording, move_condition, shared_columns
from estimation.rest import in_motion
from estimation.signals import Signals
from estimation.travel import off_ratio

SERIES_PER_CUTOFF = 5.0
"""Samples kept for each period of the filter's cutoff, for effects with memory."""

GRID_PER_CUTOFF = 1.7
"""Samples regressed on for each period of the cutoff: neighbours nearer than that are alike."""

COULOMB = "friction.coulomb"
LEAST = 20
"""Samples that an equation needs of each run."""

MOST = 24_000
"""Samples regressed on of all runs together, roughly: memory and time follow their number. A run
counts as 40 samples that are independent of one another, so more of them show nothing new."""

SHAPE_STEP = 0.02
"""Relative step of the derivative of a declared column by its shape."""

ANGLES = ("_angle_rad", "_position_m")
EFFORTS = ("_n_m", "_n")
RATES = {
    "_angle_rad": ("_velocity_rad_s", "_acceleration_rad_s2"),
    "_position_m": ("_velocity_m_s", "_acceleration_m_s2"),
}


class LayoutError(EstimationError):
    """The runs do not hold what the declared equations need."""


@dataclass(frozen=True)
class RunSignals:
    """The filtered channels of one run.

    Attributes:
        name: Name of the run.
        channels: Channel to values, each of shape (n,), SI units; further signals may be added.
        rate_hz: Rate of these values.
        step: They are every so many samples of the recording.
        noise: Channel to one realisation of its sensors' white noise, filtered in the same way.
        grid: Places regressed on, indices into n.
        used: Equation to the samples it counts, indices into `grid`.
    """

    name: str
    channels: dict[str, FloatArray]
    noise: Mapping[str, FloatArray]
    rate_hz: float
    step: int
    low_pass: LowPass
    grid: NDArray[np.intp]
    used: Mapping[str, NDArray[np.intp]]

    def shaken(self) -> "RunSignals":
        """Return the run with a second realisation of its readings' noise, without instruments."""
        return replace(
            self, channels={n: x + self.noise.get(n, 0.0) for n, x in self.channels.items()}
        )

    @cached_property
    def memo(self) -> dict[object, FloatArray | None]:
        """Columns already worked out."""
        return {}

    def on_grid(self, channel: str) -> FloatArray:
        """Return a channel at the places regressed on, shape (len(grid),)."""
        return self.once(("grid", channel), lambda: self.channels[channel][self.grid])

    def once(self, key: object, make: Callable[[], FloatArray]) -> FloatArray:
        """Return the array that was worked out under a key, or work it out now."""
        found = self.memo.get(key)
        if found is None:
            found = self.memo[key] = make()
        return found


LOSSES = ("friction.", "transmission.damping")
"""Families of declared terms that take energy from the motion."""


class Column(NamedTuple):
    """A declared column.

    Attributes:
        sign: With which its term enters.
        channel: What it is a constant times; empty where it is another function.
        of_shape: Whether it is the derivative by a shape.
        is_bounded: Whether it is the amplitude of a loss, which cannot be negative.
    """

    sign: int
    channel: str
    of_shape: bool
    is_bounded: bool


@dataclass(frozen=True)
class Equation:
    """One declared equation, fitted on the training runs.

    Attributes:
        name: Its id, such as `motor`.
        model: The fitted model.
        channels: Channel to the weight of the term that is proportional to it.
        speed: Channel of the speed its friction depends on; empty without friction.
        width: Speed over which the declared friction changes its sign; 0 without friction.
    """

    name: str
    model: Model
    channels: Mapping[str, float]
    speed: str
    width: float

    @property
    def target(self) -> str:
        """Channel on the left-hand side."""
        return self.model.target

    @property
    def of_angle(self) -> bool:
        """Whether the left-hand side is an angle or a length: a deflection, not a torque."""
        return self.model.unit in ("rad", "m")

    @property
    def terms(self) -> tuple[Term, ...]:
        """The terms, without an offset: offsets of runs are nuisance parameters."""
        return tuple(t for t in self.model.terms if t.effect.id != OFFSET)

    def columns(self, channels: Mapping[str, FloatArray]) -> FloatArray:
        """Return the declared columns, signed, and their derivatives by the shapes, (n, k)."""
        parts = []
        for term in self.terms:
            shape = term.numbers(term.effect.shape)
            weights = np.array(term.numbers(term.effect.amplitudes))
            parts.append(term.sign * term.columns(channels, shape))
            for k, value in enumerate(shape):
                step = SHAPE_STEP * (abs(value) or 1.0)
                ends = [
                    term.columns(channels, [*shape[:k], value + s * step, *shape[k + 1 :]])
                    for s in (1, -1)
                ]
                scale = weights if np.any(weights) else np.ones(len(weights))
                parts.append(term.sign * ((ends[0] - ends[1]) @ scale)[:, None])
        return np.hstack(parts)

    @cached_property
    def kinds(self) -> list[Column]:
        """What each of the columns is."""
        found = []
        for term in self.terms:
            linear = isinstance(term.effect, Proportional)
            channel = next(iter(term.channels.values())) if linear else ""
            sizes = term.effect.amplitudes
            is_loss = term.effect.family.startswith(LOSSES)
            found += [Column(term.sign, channel, False, is_loss and p.lower == 0.0) for p in sizes]
            found += [Column(term.sign, channel, True, False)] * len(term.effect.shape)
        return found

    def noise(self, run: RunSignals) -> FloatArray:
        """Return the noise in `columns` and in the target, (n, k + 1).

        A column that is not proportional to its channel is left out.
        """
        parts = []
        for term in self.terms:
            own = term.columns(run.noise, term.numbers(term.effect.shape))
            linear = isinstance(term.effect, Proportional)
            count = own.shape[1] + len(term.effect.shape)
            parts.append(term.sign * own if linear else np.zeros((len(own), count)))
        return np.hstack([*parts, run.noise[self.target][:, None]])

    def is_quieter(self, runs: Sequence[RunSignals]) -> bool:
        """Whether the right-hand side has less of its sensors' noise than the target has."""
        own, other = self.noises(runs)
        return other < own

    def noises(self, runs: Sequence[RunSignals]) -> tuple[float, float]:
        """Return the variance of sensors' noise in the target and in the right-hand side."""
        linear = [t for t in self.terms if isinstance(t.effect, Proportional)]
        own = other = 0.0
        for run in runs:
            parts = [t.columns(run.noise, ()) @ np.array(t.weights) for t in linear]
            own += float(np.var(run.noise[self.target]))
            other += float(np.var(np.sum(parts, axis=0)))
        return own / len(runs), other / len(runs)

    def estimate(self, channels: Mapping[str, FloatArray]) -> FloatArray:
        """Return the right-hand side without offsets, shape (n,)."""
        return np.asarray(
            sum(
                term.columns(channels, term.numbers(term.effect.shape)) @ np.array(term.weights)
                for term in self.terms
            )
        )


@dataclass(frozen=True)
class Layout:
    """Equations and runs.

    Attributes:
        equations: Name to equation.
        runs: The runs, in the order they were recorded.
        measured: Channels that every run has.
        shaken: The runs once more with each reading's noise added to it a second time, in the same
            order, instruments included: how a column follows noise. Filled with the instruments.
        independent: Pairs of an effort and an equation that has it from other sensors than its own.
        undecided: Declared equation that is not laid out to the reason.
        left_out: Run without enough samples of some equation to the reason.
    """

    equations: Mapping[str, Equation]
    runs: Sequence[RunSignals]
    measured: tuple[str, ...]
    shaken: list[RunSignals] = field(default_factory=list)
    independent: set[tuple[str, str]] = field(default_factory=set)
    undecided: Mapping[str, str] = field(default_factory=dict)
    left_out: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def ranges(self) -> dict[object, tuple[float, float]]:
        """Ranges of signals over the runs that were already worked out."""
        return {}

    def select(self, names: Sequence[str]) -> "Layout":
        """Return the same equations on some of the runs."""
        kept = set(names)
        return replace(
            self,
            runs=[run for run in self.runs if run.name in kept],
            shaken=[run for run in self.shaken if run.name in kept],
        )


def lay_out(
    models: Sequence[Model], recordings: Sequence[Recording], train: Sequence[str]
) -> Layout:
    """Fit declared models, one an equation, on the training runs and lay out every run.

    Raises:
        LayoutError: No run has samples enough to regress on.
        FitError: An equation cannot be identified.
    """
    timed = on_one_clock(recordings)
    campaign = Campaign.of([r for r in timed if r.name in set(train)])
    read = {c for m in models for c in measured_channels([*m.channels, m.target], m.signals)}
    measured = tuple(
        n
        for n in shared_columns(timed)
        if n != CAMPAIGN_TIME and (n in read or all(_is_whole(r, n) for r in timed))
    )
    equations: dict[str, Equation] = {}
    undecided: dict[str, EstimationError] = {}
    for model in models:
        needed = set(measured_channels([*model.channels, model.target], model.signals))
        try:
            if lacking := needed - {*measured, "time_s", CAMPAIGN_TIME}:
                raise LayoutError(
                    f"Some run has no {', '.join(sorted(lacking))}.",
                    f"The equation {model.balance} needs it. Every run has {', '.join(measured)}.",
                    move_condition(lacking, timed)
                    or "Record it, or declare an equation of channels that were recorded.",
                )
            if contradicted := off_ratio(model, list(campaign.evidence)):
                raise LayoutError(
                    contradicted,
                    "A deflection from another ratio is mostly travel.",
                    "Correct the ratio in the machine file, or the counts of one of the sensors.",
                )
            fitted = fit(model, campaign, bootstrap=0, every=None)
            if contradicted := opposed(fitted, campaign):
                raise LayoutError(
                    contradicted,
                    "A drive that seems to brake the motion has no equation with this friction.",
                    FIX,
                )
            equations[model.balance] = equation_of(fitted)
        except EstimationError as error:
            undecided[model.balance] = error
    if not equations:
        raise next(iter(undecided.values()))
    runs, lost = _laid_out(timed, equations, measured)
    reasons = {name: str(error) for name, error in undecided.items()}
    return Layout(equations, runs, measured, undecided=reasons, left_out=lost)


def _is_whole(recording: Recording, channel: str) -> bool:
    """Whether a channel has values, and each that is not finite has a flag."""
    finite = np.isfinite(recording[channel])
    return bool(finite.any() and finite[recording.valid].all())


def laid_out_like(layout: Layout, recordings: Sequence[Recording]) -> Layout:
    """Return other runs with the equations of a layout, for what a cause would do there.

    A run without enough samples of some equation is left out.

    Raises:
        LayoutError: All of them are.
    """
    runs, lost = _laid_out(on_one_clock(recordings), layout.equations, layout.measured)
    return Layout(layout.equations, runs, layout.measured, left_out=lost)


def _laid_out(
    recordings: Sequence[Recording], equations: Mapping[str, Equation], measured: Sequence[str]
) -> tuple[list[RunSignals], dict[str, str]]:
    """Return the runs, and those without enough samples of some equation with the reason."""
    runs: list[RunSignals] = []
    lost: dict[str, EstimationError] = {}
    for recording in recordings:
        try:
            runs.append(_signals(recording, equations, measured))
        except (LayoutError, FilterError) as error:
            lost[recording.name] = error
    if lost and not runs:
        raise next(iter(lost.values()))
    every = math.ceil(sum(len(run.grid) for run in runs) / MOST)
    thinned = [_thinned(run, every) for run in runs]
    return thinned, {name: error.what for name, error in lost.items()}


def _thinned(run: RunSignals, every: int) -> RunSignals:
    """Return a run with one of so many places of its grid; unchanged where it has few."""
    used = {name: at[at % every == 0] // every for name, at in run.used.items()}
    if every == 1 or min(map(len, used.values())) < LEAST:
        return run
    return replace(run, grid=run.grid[::every], used=used)


def sensitivity(name: str, measured: str, signals: Signals) -> tuple[float, int] | None:
    """Return how a channel follows an error of a measured one: (gain, times differentiated).

    None where the channel, measured or derived, does not read it.
    """
    if (combination := signals.combination(name)) is not None:
        gain = combination.gain(measured)
        return (gain, 0) if gain else None
    source, times = origin_of(name)
    return (1.0, times) if source == measured else None


def on_one_clock(recordings: Sequence[Recording]) -> list[Recording]:
    """Return the runs with the campaign's time; where no start is known they follow one another."""
    known = Campaign.of(recordings).timed()
    timed = list(known.evidence)
    if all(CAMPAIGN_TIME in r for r in timed):
        return sorted(timed, key=lambda r: float(r[CAMPAIGN_TIME][0]))
    out, start_s = [], 0.0
    for recording in sorted(recordings, key=lambda r: r.name):
        own_s = recording.time_s - recording.time_s[0]
        out.append(recording.with_columns(**{CAMPAIGN_TIME: start_s + own_s}))
        start_s += float(own_s[-1])
    return out


def equation_of(model: Model) -> Equation:
    """Return a fitted model as an equation."""
    channels: dict[str, float] = {}
    speed, width = "", 0.0
    for term in model.terms:
        if isinstance(term.effect, Proportional) and term.effect.id != OFFSET:
            (channel,) = term.channels.values()
            channels[channel] = channels.get(channel, 0.0) + float(term.weights[0])
        if term.effect.id == COULOMB:
            speed, width = term.channels["speed"], term.values["width"].value
    return Equation(model.balance, with_prediction(model), channels, speed, width)


def _signals(
    recording: Recording, equations: Mapping[str, Equation], measured: Sequence[str]
) -> RunSignals:
    models = [equation.model for equation in equations.values()]
    low_pass, signals = models[0].low_pass, models[0].signals
    joined = [c.name for c in signals.joined if c.shares[0].channel in measured]
    positions = [*measured, *(n for n in joined if signals.combination(n) is not None)]
    moved = [
        angle.removesuffix(kind) + rate
        for angle in positions
        for kind, rates in RATES.items()
        if angle.endswith(kind)
        for rate in rates
    ]
    wanted = [*positions, *moved, *(n for m in models for n in (*m.channels, m.target))]
    filtered = zero_phase_channels(recording, [*wanted, CAMPAIGN_TIME], low_pass, signals)
    valid, step, grid = _places(filtered, low_pass)
    channels = {name: np.array(filtered[name])[::step] for name in dict.fromkeys(wanted)}
    reading = measured_channels((n for n in wanted if n != CAMPAIGN_TIME), signals)
    random = zero_phase_channels(
        white_noise(recording, reading, signals), wanted, low_pass, signals
    )
    noise = {n: np.array(random[n])[::step] for n in dict.fromkeys(wanted) if n not in CLOCKS}
    channels[CAMPAIGN_TIME] = np.array(recording[CAMPAIGN_TIME])[::step]
    channels["time_s"] = (recording.time_s - recording.time_s[0])[::step]
    rate_hz = recording.sample_rate_hz / step
    used = {}
    for equation in equations.values():
        used[equation.name] = _used(equation.model, channels, valid, rate_hz, grid)
        if len(used[equation.name]) < LEAST:
            raise LayoutError(
                f"Run {recording.name!r} has {len(used[equation.name])} samples for the equation"
                f" {equation.name}.",
                "The others are flagged, at rest, or too near to the ends for the filter.",
                "Record it again, or exclude it.",
            )
    return RunSignals(recording.name, channels, noise, rate_hz, step, low_pass, grid, used)


def samples_in_motion(model: Model, recording: Recording) -> int:
    """Return the number of samples of a run that an equation is regressed on.

    Raises:
        MissingChannelError: The run lacks a channel of the equation.
    """
    filtered = balance_channels(model, recording)
    valid, step, grid = _places(filtered, model.low_pass)
    channels = {name: values[::step] for name, values in filtered.columns.items()}
    return len(_used(model, channels, valid, recording.sample_rate_hz / step, grid))


def _places(
    filtered: Recording, low_pass: LowPass
) -> tuple[NDArray[np.bool_], int, NDArray[np.intp]]:
    """Return which samples of the series are sound, its step, and the places regressed on."""
    rate_hz = filtered.sample_rate_hz
    step = max(1, int(rate_hz / (SERIES_PER_CUTOFF * low_pass.cutoff_hz)))
    edge = int(np.ceil(2 * low_pass.reach_s * rate_hz))
    spoilt = ndimage.maximum_filter1d((~filtered.valid).astype(np.uint8), 2 * edge + 1) > 0
    spoilt[:edge] = True
    spoilt[max(len(spoilt) - edge, 0) :] = True
    valid = ~spoilt[::step]
    coarse = max(1, round(rate_hz / step / (GRID_PER_CUTOFF * low_pass.cutoff_hz)))
    grid = np.arange(0, len(valid), coarse)
    return valid, step, grid[valid[grid]]


def _used(
    model: Model,
    channels: Mapping[str, FloatArray],
    valid: NDArray[np.bool_],
    rate_hz: float,
    grid: NDArray[np.intp],
) -> NDArray[np.intp]:
    """Return the places of the grid that an equation counts: those in motion, with friction."""
    speed = next((t.channels["speed"] for t in model.terms if t.effect.id == COULOMB), "")
    if not speed or model.counted == "all":
        return np.arange(len(grid))
    moving = in_motion(channels[speed], valid, rate_hz, model.signals.rest.get(speed, 0.0))
    return np.flatnonzero(moving[grid])
