"""A declared equation, fitted: its columns, their noise, and what it predicts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from estimation.causes.run_signals import COULOMB, RunSignals
from estimation.derived import origin_of
from estimation.effects import Proportional
from estimation.fit_problem import OFFSET
from estimation.model import Model, Term
from estimation.predicted import with_prediction
from estimation.recording import FloatArray
from estimation.signals import Signals

SHAPE_STEP = 0.02
"""Relative step of the derivative of a declared column by its shape."""


LINKS = "arm.links"
"""Beginning of the ids of effects whose channel was computed from the motion: no sensor reads it.
"""


class Column(NamedTuple):
    """A declared column.

    Attributes:
        sign: With which its term enters.
        channel: What is read that it is a constant times; empty where it is another function.
        of_shape: Whether it is the derivative by a shape.
        is_bounded: Whether its amplitude cannot be negative, as that of an inertia or a friction.
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
        parts, low_pass = [], self.model.low_pass
        for term in self.terms:
            shape = term.numbers(term.effect.shape)
            weights = np.array(term.numbers(term.effect.amplitudes))
            parts.append(term.sign * term.columns(channels, shape, low_pass))
            for k, value in enumerate(shape):
                step = SHAPE_STEP * (abs(value) or 1.0)
                moved = [[*shape[:k], value + s * step, *shape[k + 1 :]] for s in (1, -1)]
                ends = [term.columns(channels, own, low_pass) for own in moved]
                scale = weights if np.any(weights) else np.ones(len(weights))
                parts.append(term.sign * ((ends[0] - ends[1]) @ scale)[:, None])
        return np.hstack(parts)

    @cached_property
    def kinds(self) -> list[Column]:
        """What each of the columns is."""
        found = []
        for term in self.terms:
            linear = isinstance(term.effect, Proportional) and not term.effect.id.startswith(LINKS)
            channel = next(iter(term.channels.values())) if linear else ""
            sizes = term.effect.amplitudes
            found += [Column(term.sign, channel, False, p.lower == 0.0) for p in sizes]
            found += [Column(term.sign, channel, True, False)] * len(term.effect.shape)
        return found

    @cached_property
    def fitted(self) -> FloatArray:
        """Fitted amplitude of each of the columns; zero of a derivative by a shape."""
        parts = [[*t.weights, *[0.0] * len(t.effect.shape)] for t in self.terms]
        return np.array([x for part in parts for x in part])

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
                term.columns(channels, term.numbers(term.effect.shape), self.model.low_pass)
                @ np.array(term.weights)
                for term in self.terms
            )
        )


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


def sensitivity(name: str, measured: str, signals: Signals) -> tuple[float, int] | None:
    """Return how a channel follows an error of a measured one: (gain, times differentiated).

    None where the channel, measured or derived, does not read it.
    """
    if (combination := signals.combination(name)) is not None:
        gain = combination.gain(measured)
        return (gain, 0) if gain else None
    source, times = origin_of(name)
    return (1.0, times) if source == measured else None
