"""All equations refitted with the causes that were kept, one after another."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from estimation.causes.acting import Moved
from estimation.causes.addition import Addition
from estimation.causes.candidates import Candidate
from estimation.causes.equations import Equation
from estimation.causes.instruments import CLEAN, noise_share
from estimation.causes.layout import Layout
from estimation.causes.numbers import Numbers
from estimation.causes.refit import MOVES, Refit, Solved
from estimation.causes.run_errors import Errors
from estimation.causes.run_signals import RunSignals
from estimation.causes.sources import LATE, Source
from estimation.derived import origin_of
from estimation.diagnosis.result import Error
from estimation.diagnosis.split import Sealed
from estimation.effects import effect
from estimation.model import Estimate, Model, Term
from estimation.predicted import predicted_of
from estimation.recording import FloatArray, Recording

DRAWS = 1000
"""Resamplings of the test runs behind the interval of an error ratio."""


class Refits:
    """Every equation on all runs, which have the campaign's time, with the causes kept so far.

    Attributes:
        open: Test runs not counted in errors: a cause that begins at one time of the campaign may
            have begun before them or after.
    """

    def __init__(
        self, layout: Layout, recordings: Sequence[Recording], sealed: Sealed, numbers: Numbers
    ) -> None:
        self.layout, self.sealed, self.numbers = layout, sealed, numbers
        self.of: dict[str, Refit] = {
            name: Refit(
                e.model, recordings, sealed.discover, sealed.confirm, numbers, _noisy(layout, e)
            )
            for name, e in layout.equations.items()
        }
        self.parts: dict[str, list[Addition]] = {name: [] for name in layout.equations}
        self.open: set[str] = set()

    def add(self, candidate: Candidate, acts_in: Mapping[str, bool]) -> dict[str, Addition]:
        """Add a cause to every equation it enters, in the runs in which it acts.

        Returns what it added, by equation.
        """
        runs = [name for name, acts in acts_in.items() if acts]
        added = {}
        for name in candidate.cause.place.equations:
            if (part := self._part(candidate, name, runs)) is not None:
                self.parts[name] = [*self.parts[name], part]
                added[name] = part
        return added

    def remove(self, parts: Mapping[str, Addition]) -> None:
        """Remove what a cause added."""
        for name, part in parts.items():
            self.parts[name] = [p for p in self.parts[name] if p is not part]

    def settle(self) -> dict[int, Addition]:
        """Give every cause the shape that it was fitted with next to the others.

        Returns the identity of each part to the part with that shape.
        """
        settled: dict[int, Addition] = {}
        for name, refit in self.of.items():
            before, self.parts[name] = self.parts[name], refit.settled(self.parts[name])
            settled.update(zip(map(id, before), self.parts[name], strict=True))
        return settled

    def before(self, name: str) -> Solved:
        """Return the declared equation."""
        return self.of[name].solve([])

    def after(self, name: str) -> Solved:
        """Return the equation with the causes added so far."""
        return self.of[name].solve(self.parts[name])

    def test_errors(self, name: str, without: Addition | None = None) -> Errors:
        """Return an equation's errors on the test runs with the causes so far, or all but one."""
        parts = [p for p in self.parts[name] if p is not without]
        return self.of[name].errors(self.of[name].solve(parts), self.open)

    def sizes(self, name: str) -> dict[str, float]:
        """Return the size of an equation's error in each run, training runs too.

        Root mean squares, in the target's unit, less the mean where runs have offsets of their own.
        """
        found = self.of[name].errors_in(self.after(name), self.of[name].recordings)
        own_offsets = self.layout.equations[name].model.run_offsets
        return (found if own_offsets else found.with_means()).by_run

    def fall(self, before: Errors, after: Errors, name: str) -> float:
        """Return by how much the logarithm of an equation's error on the test runs falls.

        With each run's mean removed or left in: the larger fall; zero where the other one rises by
        more. Where runs have offsets of their own, that with the means counts less, as in the
        search.
        """
        pairs = ((before.rmse, after.rmse), (before.rmse_with_means, after.rmse_with_means))
        falls = [math.log(old / new) if new else (math.inf if old else 0.0) for old, new in pairs]
        own_offsets = self.layout.equations[name].model.run_offsets
        of_means = self.numbers.between if own_offsets else 1.0
        return max(falls) if falls[0] + of_means * falls[1] > 0.0 else min(0.0, *falls)

    def models(self) -> list[Model]:
        """Return the models with the causes that a file can hold; see `Refit.written`."""
        return [self.of[name].written(self.parts[name]) for name in self.of]

    def errors(self) -> dict[str, Error]:
        """Return the errors of every equation before and after the causes."""
        out = {}
        for name, refit in self.of.items():
            solved = (self.before(name), self.after(name))
            old, new = (refit.errors(s, self.open) for s in solved)
            out[name] = Error(
                before=old.rmse,
                after=new.rmse,
                with_means_before=old.rmse_with_means,
                with_means_after=new.rmse_with_means,
                ratio_ci95=_interval(old.centred, new.centred, self.sealed.seed),
                by_run_before=old.by_run,
                by_run_after=new.by_run,
            )
        return out

    def _part(self, candidate: Candidate, name: str, runs: Collection[str]) -> Addition | None:
        cause, equation = candidate.cause, self.layout.equations[name]
        acts = None if candidate.acts is None else frozenset(runs)
        if not isinstance(cause, Source):
            return self._columns(candidate, name, acts)
        if (term := _term(cause, replace(equation, model=self.of[name].model))) is None:
            return self._columns(candidate, name, acts) if name == cause.place.home else None
        part = Addition(term, acts, is_change=isinstance(cause, Moved))
        refit, before = self.of[name], self.parts[name]
        if set(term.channels.values()) - {channel for _, channel in cause.channels}:
            refit.predict_next_to([*before, part])
        if cause.effect.id in LATE:
            part = self._whole(part, candidate, name)
        if cause.effect.id in LATE or sum(e.equation == name for e in cause.place.enters) > 1:
            # the term is one of several ways in which the cause enters, such as a position's delay
            # by the speed and the acceleration; a late reading is early by itself, as no term is
            whole = self._columns(candidate, name, acts)
            term_left, left = (refit.solve([*before, p]).squared for p in (part, whole))
            if left < (1.0 - self.numbers.form_floor) * term_left:
                return whole
        return part

    def _whole(self, part: Addition, candidate: Candidate, name: str) -> Addition:
        """Return a delay or a lag with the time by which the whole reading is late.

        Slow motion shows the product of that time and of the share of the reading alone. The time
        stays as it was found where the motion is fast enough to show both: where the error rises.
        """
        refit, before, found = self.of[name], self.parts[name], part
        entry = next(e for e in candidate.cause.place.enters if e.equation == name and not e.order)
        least = refit.solve([*before, found]).squared
        for _ in range(MOVES):
            (amplitude,) = refit.amplitudes(part, [*before, part])
            term = part.term
            if term is None or amplitude == 0.0:
                return found
            share = abs(float(amplitude) / entry.gain)
            times = {p.name: Estimate(share * term.values[p.name].value) for p in term.effect.shape}
            part = replace(part, term=replace(term, values={**term.values, **times}))
        refit.predict_next_to([*before, part])
        if refit.solve([*before, part]).squared * (1.0 - self.numbers.form_floor) > least:
            refit.predict_next_to([*before, found])
            return found
        return part

    def _columns(self, candidate: Candidate, name: str, acts: frozenset[str] | None) -> Addition:
        """Return the columns of a cause in an equation, as a part that no model file holds."""
        cause = candidate.cause
        gain = sum(abs(e.gain) for e in cause.place.enters if e.equation == name)
        precision = 0.0 if isinstance(cause, Source) else (gain / self.numbers.knot_sd) ** 2
        whole = {run.name: _everywhere(run, candidate, name) for run in self.layout.runs}

        def columns(run: str, since_s: FloatArray) -> FloatArray:
            time_s, values = whole[run]
            acting = float(acts is None or run in acts)
            return acting * np.column_stack([np.interp(since_s, time_s, c) for c in values.T])

        return Addition(unwritten=columns, precision=precision)


def _noisy(layout: Layout, equation: Equation) -> set[str]:
    """Return the channels of an equation's terms of which a part that counts is noise."""
    channels = {column.channel for column in equation.kinds if column.channel}
    return {c for c in channels if noise_share(layout.runs, c) > CLEAN}


def _everywhere(
    run: RunSignals, candidate: Candidate, equation: str
) -> tuple[FloatArray, FloatArray]:
    """Return times and a cause's columns there, at all of a run's places, at standstill too."""
    everything = {name: np.arange(len(run.grid)) for name in run.used}
    cause = candidate.cause
    if isinstance(cause, Source):  # the form of its equation, as a model has it
        cause = replace(cause, bend=None, odd=False)
    columns = cause.columns(replace(run, used=everything)) or {}
    return run.channels["time_s"][run.grid], columns[equation]


def _interval(
    before: Mapping[str, float], after: Mapping[str, float], seed: int
) -> tuple[float, float]:
    """Return the 95 % interval of an error ratio by a bootstrap over the test runs."""
    old, new = (np.array(list(x.values())) for x in (before, after))
    draws = np.random.default_rng(seed).multinomial(
        len(old), np.full(len(old), 1 / len(old)), DRAWS
    )
    ratio = np.sqrt((draws @ new) / np.maximum(draws @ old, np.finfo(float).tiny))
    low, high = np.percentile(ratio, [2.5, 97.5])
    return float(low), float(high)


def _term(source: Source, equation: Equation) -> Term | None:
    """Return a cause as a term of one equation, its shape set and its amplitudes not.

    A term never reads the equation's own target: its prediction by the fitted equation takes its
    place, see `estimation.predicted`. None where the cause does not enter the equation
    undifferentiated, or nothing predicts the target.
    """
    own = [e for e in source.place.enters if e.equation == equation.name and not e.order and e.gain]
    if not own:
        return None
    entry, target, shape = own[0], equation.target, [Estimate(float(x)) for x in source.shape]
    if entry.load:
        return Term(
            effect("eccentric.load.harmonics"),
            int(math.copysign(1, entry.gain)),
            {**dict(source.channels), "load": entry.load},
            dict(zip(("order",), shape, strict=True)),
        )
    read = {c for _, c in source.channels if target in (c, origin_of(c)[0])}
    channels = {r: predicted_of(c, target) if c in read else c for r, c in source.channels}
    if read and equation.model.signals.combination(predicted_of(target, target)) is None:
        return None
    names = [p.name for p in source.effect.shape]
    sign = int(math.copysign(1, entry.gain * source.side))
    return Term(source.effect, sign, channels, dict(zip(names, shape, strict=True)))
