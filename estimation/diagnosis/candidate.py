"""Candidates: each effect of the catalogue at each point of its shape's grid, set in a balance."""

import itertools
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.candidates import candidates
from estimation.effects import Effect, Parameter, effect
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

ANGLE_ROLES = ("motor_angle", "output_angle", "encoder")
"""Roles that a wave's order counts the turns of."""

LEAST_PERIODS = 1.2
"""Periods of a wave that some run must cover, or it is no wave."""

LEAST_PERIODS_OF_A_FAULT = 2.0
"""And of one with harmonics, which has any form in a single period, or of one that an encoder is
blamed for: a spring that bends leaves a wave and a half."""

SLOW_TURN = 0.5
"""Share of the usual speed above which a smooth sign of the speed is no sign."""

Spans = Mapping[tuple[str, str], float]
"""Role and channel to how far runs go there."""

EARLY_KNEE = 0.25
"""Share of the usual speed below which damping that wears off with the speed is a direction."""

LEAST_REACH = 0.05
"""And reach of a loop along a torque, as a share of the widest range of that torque in a run."""


MOST_TOGETHER = 48
"""Grid points of an effect with several shape parameters at most."""


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
        return self.effect.family

    @property
    def term(self) -> Term:
        """The term of a model, without values."""
        return Term(self.effect, self.sign, dict(self.channels))

    @property
    def is_limit(self) -> bool:
        """Whether a shape stands where the effect turns into a simpler one.

        Presliding over a way that no run covers is a spring; friction whose direction takes more
        speed than any run has is viscous; a bend of a spring at no load is play.
        """
        below = self.effect.other_below
        return any(
            (not p.linear and value > step(p, p.upper, -0.5))
            or (p.name in below and value < step(p, p.lower, 0.5))
            for p, value in zip(self.effect.shape, self.shape, strict=True)
        )

    def shows(self, spans: Spans) -> bool:
        """Say whether runs show it as what it is, and not as something simpler.

        A wave of which no run covers much more than a period is a slow change with the angle; a
        direction that takes half of the usual speed to turn round goes with the speed, and damping
        that is worn off long before it with the direction; what fades more slowly than a campaign
        lasts is a line, or a step. A loop that a torque is through as soon as it turns is the noise
        of its sensor: what lags behind noise is a quieter reading.

        Args:
            spans: Role and channel to the widest range that a run covers; of a speed the usual fast
                one.
        """
        shape = {p.name: x for p, x in zip(self.effect.shape, self.shape, strict=True)}
        span = {role: spans[role, channel] for role, channel in self.channels}
        torques = [spans[r, channel] for r, channel in self.channels if channel.endswith("_n_m")]
        if "order" in shape:
            angle = next(role for role in ANGLE_ROLES if role in span)
            plain = len(self.effect.amplitudes) <= 2 and not self.family.startswith("sensor.")
            least = LEAST_PERIODS if plain else LEAST_PERIODS_OF_A_FAULT
            return shape["order"] * span[angle] >= least * 2 * math.pi
        if "width" in shape and "speed" in span and shape["width"] > SLOW_TURN * span["speed"]:
            return False
        if "reach" in shape and any(shape["reach"] < LEAST_REACH * x for x in torques):
            return False
        if "knee" in shape and "speed" in span and shape["knee"] < EARLY_KNEE * span["speed"]:
            return False
        if "campaign_clock" not in span or "time" not in shape:
            return True
        return shape["time"] <= span["campaign_clock"]

    def columns(self, channels: Mapping[str, FloatArray]) -> FloatArray:
        """Return the signed columns of one whole run, shape (n, amplitudes)."""
        inputs = {role: channels[name] for role, name in self.channels}
        for role in self.effect.projected_roles:
            name = projected(dict(self.channels)[role])
            inputs[role] = channels.get(name, inputs[role])
        return self.sign * self.effect.columns(inputs, self.shape)

    def moved(self, k: int, steps: float) -> "Candidate":
        """Return the same effect with its k-th shape moved by steps of its grid, in its bounds."""
        bound = self.effect.shape[k]
        values = list(self.shape)
        values[k] = step(bound, values[k], steps)
        return replace(self, shape=tuple(values))


def projected(channel: str) -> str:
    """Return the name under which a channel's projection on the other sensors goes."""
    return f"projected {channel}"


def step(bound: Parameter, value: float, steps: float) -> float:
    """Return a shape parameter moved by steps of its grid, kept in its bounds."""
    if bound.linear:
        moved = value + steps * (bound.upper - bound.lower) / (bound.points - 1)
    else:
        moved = value * float(
            np.exp(steps * np.log(bound.upper / bound.lower) / (bound.points - 1))
        )
    return float(min(max(moved, bound.lower), bound.upper))


def pool(
    model: Model, measured: Collection[str], instead: Mapping[str, str] | None = None
) -> list[Candidate]:
    """Return every effect the declared model lacks, at every point of its grid.

    Args:
        model: The declared model.
        measured: Channels that every run has.
        instead: Channel to the one that plays its roles.
    """
    declared = {(t.effect.id, *sorted(t.channels.items())) for t in model.terms}
    return [
        Candidate.of(term, shape)
        for term in candidates(model.balance, measured, instead, model.counted is not None)
        if term.effect.family in FAMILIES and term.effect.family != UNKNOWN
        if (term.effect.id, *sorted(term.channels.items())) not in declared
        for shape in grid(term.effect)
    ]


def grid(kind: Effect) -> Iterator[tuple[float, ...]]:
    """Walk the grid of an effect's shape; one empty point for an effect without shape."""
    points = [[float(x) for x in p.grid()] for p in kind.shape]
    if math.prod(map(len, points)) > MOST_TOGETHER and len(points) > 1:
        most = max(3, int(MOST_TOGETHER ** (1 / len(points))))
        points = [_spread(values, most) for values in points]
    return itertools.product(*points)


def related(first: Candidate, second: Candidate) -> bool:
    """Say whether two effects look alike when the excitation is poor, by their own word."""
    one, other = first.effect, second.effect
    return (
        one.family == other.family
        or bool({other.id, other.family} & set(one.confused_with))
        or bool({one.id, one.family} & set(other.confused_with))
    )


def _spread(values: list[float], most: int) -> list[float]:
    """Return at most so many of the values, evenly spread, not the outermost ones."""
    if len(values) <= most:
        return values
    places = np.linspace(0, len(values) - 1, most + 2)[1:-1]
    return [values[round(p)] for p in places]
