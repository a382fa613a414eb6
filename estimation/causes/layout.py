"""The declared equations of a machine on its runs: fitted, and laid out to be regressed on."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from estimation.campaign import Campaign
from estimation.causes.equations import Equation, equation_of
from estimation.causes.run_signals import LEAST, LayoutError, RunSignals, signals_of_run
from estimation.channels import unit_or_none
from estimation.derived import CAMPAIGN_TIME, measured_channels
from estimation.errors import EstimationError
from estimation.filters import FilterError
from estimation.fitting import fit
from estimation.model import Model
from estimation.opposed import FIX, opposed
from estimation.recording import OTHER, Recording, move_condition, shared_columns
from estimation.travel import off_ratio

MOST = 24_000
"""Samples regressed on of all runs together, roughly: memory and time follow their number. A run
counts as 40 samples that are independent of one another, so more of them show nothing new."""


OF_MOTION = ("rad", "rad/s", "rad/s^2", "m", "m/s", "m/s^2", "s", "Hz", "1")
"""Units of motion, of time, and of what is a share of something."""


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
        conditions: Stated conditions that differ between the runs, channels of every run.
        undecided: Declared equation that is not laid out to the reason.
        left_out: Run without enough samples of some equation to the reason.
    """

    equations: Mapping[str, Equation]
    runs: Sequence[RunSignals]
    measured: tuple[str, ...]
    shaken: list[RunSignals] = field(default_factory=list)
    independent: set[tuple[str, str]] = field(default_factory=set)
    conditions: tuple[str, ...] = ()
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
    timed = prepared(recordings)
    campaign = Campaign.of([r for r in timed if r.name in set(train)])
    read = {c for m in models for c in measured_channels([*m.channels, m.target], m.signals)}
    columns = [n for n in shared_columns(timed) if n != CAMPAIGN_TIME]
    stated = [n for n in columns if all(n in r.conditions for r in timed)]
    measured = tuple(
        n for n in columns if n not in stated and (n in read or all(_is_whole(r, n) for r in timed))
    )
    differ = tuple(n for n in stated if len({r.conditions[n] for r in timed}) > 1)
    equations: dict[str, Equation] = {}
    undecided: dict[str, EstimationError] = {}
    for model in models:
        needed = set(measured_channels([*model.channels, model.target], model.signals))
        try:
            if lacking := needed - {*measured, "time_s", CAMPAIGN_TIME}:
                raise LayoutError(
                    f"Some run has no {', '.join(sorted(lacking))}.",
                    f"The equation {model.balance} needs it. Every run has {', '.join(measured)}.",
                    move_condition(lacking, timed) or f"Record it. {OTHER}",
                )
            if contradicted := off_ratio(model, list(campaign.evidence)):
                raise LayoutError(
                    contradicted,
                    "A deflection from another ratio is mostly travel.",
                    "Correct the ratio in the machine file, or the counts of one of the sensors.",
                )
            fitted = _fitted(model, campaign)
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
    return Layout(equations, runs, measured, conditions=differ, undecided=reasons, left_out=lost)


def _fitted(model: Model, campaign: Campaign) -> Model:
    """Return a model fitted on all runs.

    Where most of the error is a level of each run, such as the zero of a sensor that moved, its
    shapes are those that the motion within runs shows: the levels would draw them.
    """
    fitted = fit(model, campaign, bootstrap=0, every=None)
    error = fitted.evidence
    has_levels = error is not None and error.rmse_with_means**2 > 2.0 * error.rmse**2
    if model.run_offsets or not has_levels or not any(term.effect.shape for term in model.terms):
        return fitted
    with suppress(EstimationError):  # a load that is held in each run
        within = fit(replace(model, run_offsets=True), campaign, bootstrap=0, every=None)
        kept = replace(within, run_offsets=False)
        return fit(kept, campaign, bootstrap=0, every=None, shapes="keep")
    return fitted


def _is_whole(recording: Recording, channel: str) -> bool:
    """Whether a channel has values, and each that is not finite has a flag."""
    finite = np.isfinite(recording[channel])
    return bool(finite.any() and finite[recording.valid].all())


def laid_out_like(layout: Layout, recordings: Sequence[Recording]) -> Layout:
    """Return other runs with the equations of a layout, for what a cause would do there.

    A run without enough samples of some equation is left out. A condition that is not stated of a
    run is the mean one.

    Raises:
        LayoutError: All of them are.
    """
    usual = {n: float(np.mean([r.channels[n][0] for r in layout.runs])) for n in layout.conditions}
    stated = [replace(r, conditions={**usual, **r.conditions}) for r in recordings]
    runs, lost = _laid_out(prepared(stated), layout.equations, layout.measured)
    return Layout(layout.equations, runs, layout.measured, left_out=lost)


def _laid_out(
    recordings: Sequence[Recording], equations: Mapping[str, Equation], measured: Sequence[str]
) -> tuple[list[RunSignals], dict[str, str]]:
    """Return the runs, and those without enough samples of some equation with the reason."""
    runs: list[RunSignals] = []
    lost: dict[str, EstimationError] = {}
    models = {name: equation.model for name, equation in equations.items()}
    for recording in recordings:
        try:
            runs.append(signals_of_run(recording, models, measured))
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


def prepared(recordings: Sequence[Recording]) -> list[Recording]:
    """Return the runs, by their start, with the campaign's time and their conditions as channels.

    Where no start is known they follow one another. Conditions are those that are numbers in a
    stated unit, but for those of motion and time: the channels have the motion itself.
    """
    return [_with_conditions(recording) for recording in _on_one_clock(recordings)]


def _with_conditions(recording: Recording) -> Recording:
    return recording.with_columns(
        **{
            name: np.full(len(recording), value)
            for name, value in recording.conditions.items()
            if not isinstance(value, str) and _is_state(name) and name not in recording
        }
    )


def _is_state(condition: str) -> bool:
    """Whether a condition is in the unit of something else than motion and time."""
    unit = unit_or_none(condition)
    return unit is not None and unit not in OF_MOTION


def _on_one_clock(recordings: Sequence[Recording]) -> list[Recording]:
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
