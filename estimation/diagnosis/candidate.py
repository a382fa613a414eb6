"""Candidates: each effect of the catalogue at each point of its shape's grid, set in a balance."""

import itertools
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.derived import measured_channels
from estimation.effects import Effect, Parameter, catalogue, effect
from estimation.model import Model, Term
from estimation.recording import FloatArray

FAMILIES = [
    "friction.coulomb",
    "friction.coulomb_asymmetry",
    "friction.viscous",
    "friction.viscous_asymmetry",
    "friction.drag",
    "friction.stribeck",
    "friction.dwell",
    "friction.load",
    "friction.load_viscous",
    "friction.capstan",
    "friction.position",
    "friction.warmup",
    "hysteresis.presliding",
    "hysteresis.bouc_wen",
    "spring.position",
    "spring.end_stop",
    "gravity.payload",
    "ripple.motor",
    "ripple.output",
    "ripple.current",
    "eccentric.load",
    "motor.saturation",
    "motor.thermal",
    "motor.electrical",
    "transmission.backlash",
    "transmission.stiffening",
    "transmission.relaxation",
    "compliance.link",
    "coupling.kinematic",
    "coupling.torque",
    "sensor.gain_nonlinear",
    "sensor.drift",
    "sensor.creep",
    "sensor.crosstalk",
    "sensor.delay",
    "sensor.lag",
    "sensor.encoder_inl",
    "inertia.missing",
    "change.step",
    "unknown",
]
"""Family ids a diagnosis may report; fixed, since other tools read them."""

UNKNOWN = "unknown"

POINTS = 13
"""Grid points of a lone shape parameter, evenly spread over its logarithm."""

MOST_TOGETHER = 48
"""Grid points of an effect with several shape parameters at most."""

STAND_IN = {"motor": "motor_current_a", "cable": "distal_torque_n_m", "grasp": "motor_current_a"}
"""What plays a role whose channel is the balance's own target.

A sensor held against its own residual finds its own noise, and a live model does not have it."""

LOSS_SIGN = {"motor": -1, "grasp": -1, "cable": 1}
"""Side of the balance a loss stands on."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """An effect at one shape, set in a balance. Plain data, so that it travels to other processes.

    Attributes:
        id: Id of the effect.
        sign: Side of the balance.
        channels: Role and channel, in pairs.
        shape: Values of its shape parameters.
    """

    id: str
    sign: int
    channels: tuple[tuple[str, str], ...]
    shape: tuple[float, ...]

    @classmethod
    def of(cls, term: Term, shape: Sequence[float]) -> "Candidate":
        """Return a model's term at a shape."""
        return cls(term.effect.id, term.sign, tuple(term.channels.items()), tuple(shape))

    @property
    def effect(self) -> Effect:
        """The effect."""
        return effect(self.id)

    @property
    def family(self) -> str:
        """What a diagnosis calls it."""
        return self.id

    @property
    def term(self) -> Term:
        """The term of a model, without values."""
        return Term(self.effect, self.sign, dict(self.channels))

    def columns(self, channels: Mapping[str, FloatArray]) -> FloatArray:
        """Return the signed columns of one whole run, shape (n, amplitudes)."""
        inputs = {role: channels[name] for role, name in self.channels}
        return self.sign * self.effect.columns(inputs, self.shape)

    def moved(self, k: int, steps: float) -> "Candidate":
        """Return the same effect with its k-th shape moved by steps of its grid, in its bounds."""
        bound = self.effect.shape[k]
        values = list(self.shape)
        values[k] = step(bound, values[k], steps)
        return replace(self, shape=tuple(values))


def step(bound: Parameter, value: float, steps: float) -> float:
    """Return a shape parameter moved by steps of its grid, kept in its bounds."""
    moved = value * (bound.upper / bound.lower) ** (steps / (POINTS - 1))
    return float(min(max(moved, bound.lower), bound.upper))


def pool(model: Model, measured: Collection[str]) -> list[Candidate]:
    """Return every effect the declared model lacks, at every point of its grid.

    Args:
        model: The declared model.
        measured: Channels that every run has.
    """
    found: list[Candidate] = []
    for kind in catalogue().values():
        channels = _channels(kind, model)
        if kind.id not in FAMILIES or kind.id == UNKNOWN or channels is None:
            continue
        if not set(measured_channels(channels.values())) <= set(measured):
            continue
        if any(t.effect.id == kind.id and dict(t.channels) == channels for t in model.terms):
            continue
        for sign in _signs(kind, model):
            found += [Candidate.of(Term(kind, sign, channels), shape) for shape in grid(kind)]
    return found


def grid(kind: Effect) -> Iterator[tuple[float, ...]]:
    """Walk the grid of an effect's shape; one empty point for an effect without shape."""
    count = len(kind.shape)
    most = POINTS if count < 2 else max(3, int(MOST_TOGETHER ** (1 / count)))
    # not the bounds themselves: there a shape mostly is another effect
    points = [np.geomspace(p.lower, p.upper, most + 2)[1:-1].tolist() for p in kind.shape]
    return itertools.product(*points)


def related(first: Candidate, second: Candidate) -> bool:
    """Say whether two effects look alike when the excitation is poor, by their own word."""
    return (
        first.id == second.id
        or second.id in first.effect.confused_with
        or first.id in second.effect.confused_with
    )


def _channels(kind: Effect, model: Model) -> dict[str, str] | None:
    """Return the channel of each role, or None when the balance's own sensor has no stand-in."""
    channels = dict(kind.roles)
    for role, channel in channels.items():
        if channel == model.target:
            if model.balance not in STAND_IN:
                return None
            channels[role] = STAND_IN[model.balance]
    return channels


def _signs(kind: Effect, model: Model) -> tuple[int, ...]:
    if all(p.lower < 0 for p in kind.amplitudes):
        return (1,)
    if kind.id.split(".")[0] in ("friction", "hysteresis", "inertia"):
        declared = {t.sign for t in model.terms if t.effect.id.startswith("friction.")}
        if len(declared) == 1:
            return (declared.pop(),)
        if model.balance in LOSS_SIGN:
            return (LOSS_SIGN[model.balance],)
    return (1, -1)
