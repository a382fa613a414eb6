"""A model: one equation of the rig, the channel it estimates, and its effects.

What is declared, what is fitted, what a residual search adds and what runs live is this same
object. A parameter without a value is one that has not been fitted yet.
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import derived, live_channels
from estimation.channels import evaluate, unit_of
from estimation.effects import Effect, Parameter, Waves
from estimation.errors import EstimationError, nearest
from estimation.filters import PAPER, LowPass
from estimation.passed import passed
from estimation.recording import FloatArray, Recording
from estimation.rest import SPINDLE_SPEED
from estimation.signals import Samples, Signals, reference


class ModelError(EstimationError):
    """A model is inconsistent, or lacks a requested value."""


class NotFittedError(ModelError):
    """A model has parameters without values."""


AT_BOUND = (
    "A parameter at its bound is not identified: noise of its channel, an effect that the equation"
    " lacks, or too little motion."
)
"""What a parameter at its bound means."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A parameter's value and how sure it is.

    Attributes:
        value: Value in the unit of the parameter.
        spread: Standard deviation over a bootstrap of runs, or None when it is not known.
        ci95: 95 % interval of the same bootstrap, or None.
    """

    value: float
    spread: float | None = None
    ci95: tuple[float, float] | None = None


@dataclass(frozen=True)
class Term:
    """One effect in a model.

    Attributes:
        sign: Side of the equation: 1 adds to the target, -1 subtracts from it.
        channels: Role to channel name.
        values: Parameter name to estimate; what is missing is not fitted. The value of a shape
            parameter is also where a fit starts.
    """

    effect: Effect
    sign: int = 1
    channels: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, Estimate] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.sign not in (1, -1):
            raise ModelError(f"The sign of {self.effect.id} is {self.sign}; it is 1 or -1.")
        known = [p.name for p in self.parameters]
        for given, allowed, what in (
            (self.channels, list(self.effect.roles), "role"),
            (self.values, known, "parameter"),
        ):
            for name in given:
                if name not in allowed:
                    raise ModelError(
                        f"{self.effect.id} has no {what} {name!r}.", nearest(name, allowed)
                    )
        object.__setattr__(
            self, "channels", MappingProxyType({**self.effect.roles, **self.channels})
        )
        object.__setattr__(self, "values", MappingProxyType(dict(self.values)))

    def __reduce__(self) -> tuple[object, ...]:
        """Travel to other processes: a view of a mapping does not."""
        return Term, (self.effect, self.sign, dict(self.channels), dict(self.values))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters of the effect: the amplitudes, then the shape."""
        return (*self.effect.amplitudes, *self.effect.shape)

    def is_at_bound(self, parameter: Parameter) -> bool:
        """Whether a parameter is the least or the largest value that makes sense.

        A whole number, such as a harmonic, is not: it is chosen and not fitted.
        """
        return not parameter.is_count and self.values[parameter.name].value in (
            parameter.lower,
            parameter.upper,
        )

    def unit(self, parameter: Parameter, target: str) -> str:
        """Return the unit symbol of a parameter when this term estimates `target`."""
        roles = {role: unit_of(channel) for role, channel in self.channels.items()}
        return evaluate(parameter.unit, {"target": unit_of(target), "rad": "rad", **roles})

    def numbers(self, parameters: Sequence[Parameter]) -> list[float]:
        """Return the values of parameters; NotFittedError where one has none."""
        missing = [p.name for p in parameters if p.name not in self.values]
        if missing:
            raise NotFittedError(
                f"{self.effect.id} has no value for {', '.join(missing)}.",
                "The model is declared but not fitted.",
                "Fit it on a campaign, or name a fitted model file.",
            )
        return [self.values[p.name].value for p in parameters]

    @property
    def weights(self) -> list[float]:
        """Signed amplitudes, one a column."""
        return [self.sign * value for value in self.numbers(self.effect.amplitudes)]

    @property
    def turning(self) -> str:
        """The channel of the angle or the position that a wave repeats with; empty of others."""
        return self.channels[self.effect.turning] if isinstance(self.effect, Waves) else ""

    @property
    def reads(self) -> tuple[str, ...]:
        """The channels of its columns: a wave is passed by the filter as its speed allows."""
        speeds = derived.rates_of(self.turning)[:1]
        return tuple(dict.fromkeys((*self.channels.values(), *speeds)))

    def columns(
        self,
        channels: Mapping[str, FloatArray] | Recording,
        shape: Sequence[float],
        low_pass: LowPass | None = None,
    ) -> FloatArray:
        """Return the effect's columns on a run's channels, without sign, shape (n, columns).

        With the filter that the channels went through, a wave is what the filter passes of it.
        """
        inputs = {role: channels[channel] for role, channel in self.channels.items()}
        columns = self.effect.columns(inputs, shape)
        gains = self.passed(channels, shape, low_pass) if low_pass is not None else []
        return np.asarray(columns * np.column_stack(gains)) if gains else columns

    def passed(
        self, channels: Mapping[str, Any] | Recording, shape: Sequence[float], low_pass: LowPass
    ) -> list[Any]:
        """Return the filter's gain on each column of a wave; empty of another effect."""
        if not isinstance(self.effect, Waves):
            return []
        speed = channels[self.reads[-1]]
        return [passed(order, speed, low_pass) for order in self.effect.orders(shape)]


@dataclass(frozen=True, slots=True)
class Evidence:
    """Data and errors of a model's fit.

    Attributes:
        samples: Samples that entered the fit.
        rmse: Root mean square error with each run's mean error removed, in the target's unit.
        rmse_with_means: The same with the means left in.
        seed: Seed of the bootstrap behind the spreads.
        run_spread: Standard deviation over runs of the logarithm of a run's error, None where a
            single run was fitted or the file does not contain it.
        target_range: Least and greatest value of the target in the fit; None where the file does
            not contain it.
        half_width: Half the 95 % interval of the estimate live, of errors on runs not fitted on;
            None where not known.
        sample_rate_hz: Median rate of the runs, Hz; None where the file does not contain it.
        made_at: When it was fitted, ISO 8601 with offset from UTC; empty if unknown.
        rig: Names of the rigs of the runs, with commas between; empty if unknown.
    """

    runs: tuple[str, ...]
    samples: int
    rmse: float
    rmse_with_means: float
    seed: int
    run_spread: float | None = None
    target_range: tuple[float, float] | None = None
    half_width: float | None = None
    sample_rate_hz: float | None = None
    made_at: str = ""
    rig: str = ""
    is_simulated: bool = False


@dataclass(frozen=True)
class Model:
    """One equation: the channel it estimates, and its effects.

    Attributes:
        balance: Id of the equation: as the machine's file calls it, `joint.N` of an arm, or
            `calibration.KIND`.
        run_offsets: Whether an offset of each run is a nuisance of a fit, as for a sensor whose
            zero drifts. Not where the runs differ by what is to be estimated, such as a load that
            is held within a run.
        counted: Which samples count, or None for what suits the effects; see `samples`.
        evidence: Data and errors of the fit, or None for a declared model.
        signals: Derived channels and speeds of standstill of the machine that it is of.
    """

    name: str
    balance: str
    target: str
    terms: tuple[Term, ...]
    description: str = ""
    low_pass: LowPass = PAPER
    run_offsets: bool = True
    counted: Samples | None = None
    evidence: Evidence | None = None
    signals: Signals = field(default_factory=reference)

    def __post_init__(self) -> None:
        unit_of(self.target)
        if not re.fullmatch(r"[A-Za-z]\w*(\.\S+)?", self.balance):
            raise ModelError(
                f"{self.balance!r} is not a name of an equation.",
                fix="Use letters, digits and underscores, such as motor or joint.3.",
            )
        if not self.terms:
            raise ModelError(f"The model {self.name!r} has no effect.", "It estimates nothing.")

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels the effects read, without the target."""
        names = (name for term in self.terms for name in term.reads)
        return tuple(dict.fromkeys(names))

    @property
    def samples(self) -> Samples:
        """Which samples the model is fitted and judged on.

        Unless declared: friction is undetermined at standstill, where it takes any value.
        """
        if self.counted is not None:
            return self.counted
        friction = any(term.effect.id.startswith("friction.") for term in self.terms)
        return "motion" if friction else "all"

    @property
    def unit(self) -> str:
        """Unit symbol of the target."""
        return unit_of(self.target)

    @property
    def is_fitted(self) -> bool:
        """Whether every parameter has a value."""
        return all(p.name in term.values for term in self.terms for p in term.parameters)


def parameter_keys(model: Model) -> list[tuple[Term, Parameter, str]]:
    """Return the parameters of a model with a name each, such as `friction.coulomb.friction`.

    A name that two terms would share has their channels too:
    `transmission.ratio(rod_force_n).ratio`.
    """
    known = [(term, p) for term in model.terms for p in term.parameters]
    count = Counter((term.effect.id, p.name) for term, p in known)
    found = []
    for term, p in known:
        is_shared = count[term.effect.id, p.name] > 1
        which = f"({', '.join(term.channels.values())})" if is_shared else ""
        found.append((term, p, f"{term.effect.id}{which}.{p.name}"))
    return found


def balance_channels(model: Model, recording: Recording) -> Recording:
    """Return the model's channels and its target, filtered alike and without lag.

    Raises:
        MissingChannelError: The recording lacks a channel.
        FilterError: The run cannot be filtered.
    """
    wanted = [*model.channels, model.target]
    if model.samples == "closing":
        wanted.append(SPINDLE_SPEED)
    return _filtered(model, recording, wanted, causal=False)


def _filtered(model: Model, recording: Recording, wanted: Sequence[str], causal: bool) -> Recording:
    source = live_channels.causal_channels if causal else derived.zero_phase_channels
    return source(recording, wanted, model.low_pass, signals=model.signals)


def settled(model: Model, channels: Recording, step: int = 1) -> NDArray[np.intp]:
    """Return the places of every n-th sample that counts for a model, see `settled_places`."""
    return derived.settled_places(channels, model.low_pass, step, model.samples, model.signals)


def estimate(model: Model, channels: Mapping[str, FloatArray] | Recording) -> FloatArray:
    """Return the estimate from filtered channels, shape (n,), in `model.unit`.

    Raises:
        NotFittedError: A parameter has no value.
    """
    parts = [
        term.columns(channels, term.numbers(term.effect.shape), model.low_pass)
        @ np.array(term.weights)
        for term in model.terms
    ]
    total: FloatArray = np.sum(parts, axis=0)
    return total


def counted_error(model: Model, recording: Recording, causal: bool = False) -> FloatArray:
    """Return the target less the estimate at the samples that count for a model, shape (k,).

    The target is without lag. With `causal` the estimate is the live one, see `predict`.

    Raises:
        NotFittedError: A parameter has no value.
        MissingChannelError: The recording lacks a channel.
    """
    channels = balance_channels(model, recording)
    found = predict(model, recording, causal) if causal else estimate(model, channels)
    return (channels[model.target] - found)[settled(model, channels)]


def predict(model: Model, recording: Recording, causal: bool = False) -> FloatArray:
    """Estimate the target of one run, which need not have it: shape (n,), in `model.unit`.

    With `causal` the channels are filtered as live, with lag, so that the result is the live one to
    rounding; a sample with a channel that is not finite then gives NaN.

    Raises:
        NotFittedError: A parameter has no value.
        MissingChannelError: The recording lacks a channel.
    """
    return estimate(model, _filtered(model, recording, model.channels, causal))


def with_values(model: Model, values: Sequence[Mapping[str, Estimate]]) -> Model:
    """Return the model with new parameter values, one mapping a term, and without evidence."""
    terms = tuple(replace(term, values=new) for term, new in zip(model.terms, values, strict=True))
    return replace(model, terms=terms, evidence=None)
