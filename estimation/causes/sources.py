"""An effect of the catalogue at a place and a shape as a candidate cause: what it adds where."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from estimation.causes.instruments import signal
from estimation.causes.places import CLOCKS, Place
from estimation.causes.run_signals import ANGLES, RunSignals
from estimation.effects import Effect, Pointwise, Waves
from estimation.filters import holoborodko_derivative
from estimation.passed import passed
from estimation.recording import FloatArray

ANGLE_STEP_RAD = 1e-4
"""Step of a derivative by an angle."""

READ_LATE = ("sensor.delay", "sensor.lag")
LATE = (*READ_LATE, "motor.electrical")
LEAST_LATE, MOST_LATE = 0.3, 1.5
"""Share of a reading that a delay or a lag makes late, at least and at most. It is the whole
reading, but for noise; a small slow share is creep."""


@dataclass(frozen=True)
class Bend:
    """How far a cause's true form may be from its equation: source(x) (1 + smooth function of it).

    Attributes:
        knots: Values of the source at which hat functions stand.
        sd: Prior standard deviation of a knot's own amplitude.
    """

    knots: tuple[float, ...]
    sd: float


@dataclass(frozen=True)
class Source:
    """An effect at one place and shape.

    Attributes:
        place: Where it acts.
        effect: The effect.
        channels: Role to the channel that plays it, before instruments.
        shape: Values of its shape parameters.
        parts: Which of its columns take part, so that simpler forms compete too.
        odd: Whether half the difference to the same filter backwards in time stands in for it: its
            correlation with the stationary noise of what it reads is zero.
        ahead: Whether its reading is what is late, so that its whole form is an advance of that
            reading, and a delay of what other sensors predict for it.
        bend: Its deviation from its equation, after the column itself; none if None.
        as_read: Whether its channels are read, also where another sensor or the equation predicts
            them.
        tried: How many points it was chosen from by the error, of which it is the only candidate;
            0 where all of them are.
    """

    place: Place
    effect: Effect
    channels: tuple[tuple[str, str], ...]
    shape: tuple[float, ...]
    parts: tuple[int, ...]
    odd: bool = False
    ahead: bool = False
    bend: Bend | None = None
    as_read: bool = False
    tried: int = 0

    @property
    def family(self) -> str:
        """What a verdict calls it."""
        return self.effect.family

    @property
    def column(self) -> int | None:
        """Number of its equation's declared column whose factor it changes; None of another one."""
        return None

    @property
    def is_declared(self) -> bool:
        """Whether it is a term of the declared equation, with another factor in some runs."""
        return False

    @property
    def reads(self) -> tuple[str, ...]:
        """Channels that its columns come from, before instruments."""
        return tuple(channel for role, channel in self.channels if role not in CLOCKS)

    @property
    def side(self) -> int:
        """Sign of a loss that its amplitudes are bounded for: an actuator's, and a deflection's."""
        if self.place.kind == "actuator":
            return next(iter(self.effect.balances.values()), 1)
        if self.place.kind == "deflection":
            return self.effect.balances.get(self.place.like, 1)
        return 1

    @property
    def least(self) -> float:
        """Size that its amplitude has at least: a reading is late as a whole."""
        return LEAST_LATE if self.effect.id in LATE else 0.0

    @property
    def most(self) -> float:
        """Size that its amplitude has at most."""
        return MOST_LATE if self.effect.id in LATE else math.inf

    @property
    def is_bounded(self) -> bool:
        """Whether its amplitudes have a sign: all but a loop over the load of what it bends."""
        if self.place.kind.endswith("sensor") and self.effect.id in (*LATE, "sensor.creep"):
            return True  # no reading is early; its place has its sign in every equation
        of_load = any(r == "travel" and not c.endswith(ANGLES) for r, c in self.channels)
        lower = [self.effect.amplitudes[k].lower for k in self.parts]
        return min(lower) >= 0.0 and not of_load

    @cached_property
    def on_grid(self) -> bool:
        """Whether its columns need no other samples than those that are regressed on."""
        return isinstance(self.effect, Pointwise) and not any(e.order for e in self.place.enters)

    @property
    def is_wave(self) -> bool:
        """Whether it repeats with an angle or a position."""
        return isinstance(self.effect, Waves)

    @property
    def turning(self) -> str:
        """The role of the angle or position that a wave repeats with."""
        return self.effect.turning if isinstance(self.effect, Waves) else ""

    def directed(self, amplitude: float) -> "Source":
        """Return a cause that was found by its odd part, with the direction that this shows.

        A reading is late in any case. At a drive the reading of its current may be late, with a
        negative amplitude, or what the current drives.
        """
        is_late = self.effect.id in READ_LATE
        return replace(self, ahead=is_late and (self.place.kind != "actuator" or amplitude < 0.0))

    def values(self, run: RunSignals) -> FloatArray | None:
        """Return the source's columns over the run, (n, parts), as its own equation reads them.

        None where a column is not finite. Of a source that needs no other samples, these are those
        of the run's grid.
        """
        found = _worked_out(self, self._names(run, self.place.home), run, "")
        return None if found is None else found[:, list(self.parts)]

    def columns(self, run: RunSignals) -> Mapping[str, FloatArray] | None:
        """Return the source's columns in every equation it enters, at the samples each counts."""
        made: dict[str, FloatArray] = {}
        series: dict[object, FloatArray | None] = {}
        bends_first = None if self.on_grid else self.bend  # before it is differentiated
        whole = len(self.parts) == len(self.effect.amplitudes)
        chosen = slice(None) if whole else list(self.parts)
        for entry in self.place.enters:
            names = self._names(run, entry.equation)
            load = entry.load and signal(run, entry.load, entry.equation)
            form = (self.effect.id, self.shape, names, self.odd, self.ahead, load, self.on_grid)
            key = (form, entry.order, bends_first, bends_first and self.parts)
            if key not in run.memo:  # of the grid alone: the whole run is many times as long
                if form not in series:
                    series[form] = _worked_out(self, names, run, load)
                found = series[form]
                if found is not None and bends_first is not None:
                    found = _bent(found[:, chosen], bends_first)
                if found is not None and not self.on_grid:
                    found = _derived(found, run, entry.order, self.is_wave)[run.grid]
                run.memo[key] = found
            found = run.memo[key]
            if found is None:
                return None
            if bends_first is None:
                found = found[:, chosen]
                found = found if self.bend is None else _bent(found, self.bend)
            used = found.take(run.used[entry.equation], axis=0)
            used *= entry.gain * self.side
            made[entry.equation] = made[entry.equation] + used if entry.equation in made else used
        return made

    def _names(self, run: RunSignals, equation: str) -> tuple[str, ...]:
        return tuple(signal(run, channel, equation, self.as_read) for _, channel in self.channels)


def _worked_out(
    source: Source, names: Sequence[str], run: RunSignals, load: str
) -> FloatArray | None:
    effect, roles = source.effect, [role for role, _ in source.channels]
    read = run.on_grid if source.on_grid else run.channels.__getitem__
    seen = {r: read(n) for r, n in zip(roles, names, strict=True)}
    columns = effect.columns(seen, source.shape)
    if load:
        ends = [
            effect.columns({r: x + step for r, x in seen.items()}, source.shape)
            for step in (ANGLE_STEP_RAD, -ANGLE_STEP_RAD)
        ]
        columns = read(load)[:, None] * (ends[0] - ends[1]) / (2.0 * ANGLE_STEP_RAD)
    reads_itself = tuple(names) == tuple(c for _, c in source.channels)
    is_late = source.ahead or (source.odd and source.place.kind != "actuator")
    if reads_itself and is_late and effect.id == "sensor.lag":
        columns = -source.shape[0] * _rate(seen["reading"][:, None], run, source.shape[0])
    elif source.odd or (source.ahead and reads_itself):
        back = {r: x[::-1] if r not in CLOCKS else x[-1] - x[::-1] for r, x in seen.items()}
        earlier = -effect.columns(back, source.shape)[::-1]
        columns = 0.5 * (columns + earlier) if source.odd else earlier
    if not np.isfinite(columns).all():
        return None
    if isinstance(effect, Waves):
        speed = _turning_speed(run, names[roles.index(source.turning)])
        speed = speed[run.grid] if source.on_grid else speed
        gains = [passed(order, speed, run.low_pass) for order in effect.orders(source.shape)]
        columns = columns * np.column_stack(gains)
    return columns


def _rate(reading: FloatArray, run: RunSignals, lag_s: float, part: float = 0.25) -> FloatArray:
    """Return the rate of a reading, shape (n, 1), over a part of its lag to either side.

    A lag times the rate of the reading is what the reading is late by, which is odd in time. Over
    less than a part of the lag the reading has little but noise.
    """
    step, at = part * lag_s * run.rate_hz, np.arange(len(reading))
    if step < 1.0:
        return _derived(reading, run, 1, is_wave=False)
    later, earlier = (np.interp(at + shift, at, reading[:, 0]) for shift in (step, -step))
    return np.asarray((later - earlier) * run.rate_hz / (2.0 * step))[:, None]


def _bent(columns: FloatArray, bend: Bend) -> FloatArray:
    """Return columns and, after them, those of the first one's deviation from its equation."""
    inside = np.clip(columns[:, 0], bend.knots[0], bend.knots[-1])
    hats = [np.interp(inside, bend.knots, row) for row in np.eye(len(bend.knots))]
    return np.column_stack([columns, columns * np.array(hats).T])


def _turning_speed(run: RunSignals, angle: str) -> FloatArray:
    """Return the speed of an angle or a position over the run, without sign, shape (n,)."""
    return run.once(
        ("turning", angle), lambda: np.abs(np.gradient(run.channels[angle])) * run.rate_hz
    )


def _derived(columns: FloatArray, run: RunSignals, order: int, is_wave: bool) -> FloatArray:
    """Return the time derivative of columns of order 0 to 2.

    A wave may be nearly as fast as half the recording's rate, where the channels' differentiator
    takes much off. It is differentiated as they are, unless the series has fewer samples than the
    recording: then the channels have next to none of that error.
    """
    for _ in range(order):
        if is_wave and run.step == 1:
            columns = holoborodko_derivative(columns, 1.0 / run.rate_hz)
        else:
            wide = np.pad(columns, ((2, 2), (0, 0)), mode="edge")
            near, far = wide[3:-1] - wide[1:-3], wide[4:] - wide[:-4]
            columns = (8.0 * near - far) * (run.rate_hz / 12.0)
    return columns
