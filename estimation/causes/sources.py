"""Candidate causes: an effect of the catalogue at a place, at the points of a grid of its shapes.

Grids follow the data: a speed is searched over the speeds there are, a travel over the travel. An
effect that is not distinguishable from a simpler one over that range is left out.
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.signal import detrend

from estimation.causes.angles import signals_of, travel_of
from estimation.causes.equations import ANGLES, Layout, RunSignals
from estimation.causes.instruments import signal
from estimation.causes.orders import largest_orders, orders_elsewhere
from estimation.causes.places import CLOCKS, Place, direction_width
from estimation.effects import Effect, Parameter, Pointwise, catalogue
from estimation.filters import holoborodko_derivative
from estimation.recording import FloatArray
from estimation.rest import longest_rest_s

DECLARED_ONLY = (
    "arm.",
    "compliance.",
    "motor.torque_constant",
    "sensor.offset",
    "transmission.ratio",
    "transmission.damping",
)
DECLARED_FRICTION = ("friction.coulomb", "friction.viscous")
SYNONYMS = ("friction.capstan",)
"""Effects that another one stands for.

Over a constant wrap a cable's pull is multiplied by cosh(wrap) + sinh(wrap) sign: the second part
is `friction.load`, the first one a factor of the load, which equations have.
"""
NOT_A_LOSS = (
    "motor.",
    "ripple.current",
    "sensor.",
    "transmission.",
    "hysteresis.bouc_wen.twist",
    "change.step.offset",
    "inertia.missing",
)
OF_KIND: Mapping[str, tuple[str, ...]] = {
    "lever": ("eccentric.load.pulley",),
    "actuator": ("motor.", "ripple.current", "sensor.delay", "sensor.gain_nonlinear"),
    "deflection": (
        "coupling.kinematic",
        "transmission.",
        "hysteresis.bouc_wen.twist",
        "hysteresis.presliding",
        "ripple.output",
        "eccentric.load",
    ),
    "torque sensor": (
        "sensor.gain_nonlinear",
        "sensor.drift",
        "sensor.creep",
        "sensor.lag",
        "sensor.delay",
        "sensor.crosstalk",
        "change.step.offset",
    ),
    "angle sensor": ("sensor.encoder_inl", "sensor.delay", "sensor.lag"),
}
"""Kind of a place to the effects that act there; at a loss all others act but some."""

FILTERS = (
    "sensor.delay",
    "sensor.lag",
    "sensor.creep",
    "motor.electrical",
    "transmission.relaxation",
)
"""Effects that pass a reading through a linear filter, as smoothing its noise does."""

LOOPS = ("hysteresis.", "transmission.backlash")
"""Effects with a loop: at a constant load they follow the noise of its reading."""

OVER_TIME = ("friction.warmup", "sensor.drift", "change.step", "motor.thermal")
"""Effects that a time in the run stands for."""

TURNING = ("motor_angle", "output_angle", "encoder")
KNOWN = ("motor", "gearbox", "cable", "stretch", "grasp")
"""Equations of the reference rig that effects name."""

OF_FEW = (
    "friction.capstan",
    "inertia.position",
    "motor.dead_zone",  # of a command: the rig's motor is read by its measured current
    "motor.gain_by_side",
    "motor.gain_by_position",  # a rotating motor has a ripple of its constant instead
)
"""Families that the reference rig has in the equations that their effects name, and in no other."""

NARROW = 0.02
"""Speed over which friction changes its sign where none is declared, share of the usual most."""

ANGLE_STEP_RAD = 1e-4
"""Step of a derivative by an angle."""

OF_ANY_ORDER = ("ripple.motor", "ripple.output", "ripple.current", "eccentric.load")
"""Waves that a shaft may make which turns by another ratio; an encoder is on its own shaft."""

SERIES = ("inertia.position.harmonics",)
"""Effects of several harmonics of one turn: over less than a turn these are nearly the same."""

LATE = ("sensor.delay", "sensor.lag", "motor.electrical")
LEAST_LATE, MOST_LATE = 0.3, 1.5
"""Share of a reading that a delay or a lag makes late, at least and at most. It is the whole
reading, but for noise; a small slow share is creep."""

LEAST_PERIODS, MOST_PERIODS = 2.0, 60.0
"""Periods of a harmonic that some run must cover: fewer are a slow change with the angle."""


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
        bend: Its deviation from its equation, after the column itself; none if None.
        tried: How many points it was chosen from by the error, of which it is the only candidate;
            0 where all of them are.
    """

    place: Place
    effect: Effect
    channels: tuple[tuple[str, str], ...]
    shape: tuple[float, ...]
    parts: tuple[int, ...]
    odd: bool = False
    bend: Bend | None = None
    tried: int = 0

    @property
    def family(self) -> str:
        """What a verdict calls it."""
        return self.effect.family

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

    @cached_property
    def is_wave(self) -> bool:
        """Whether it repeats with an angle or a position."""
        return any(parameter.name == "order" for parameter in self.effect.shape)

    @cached_property
    def turning(self) -> str:
        """The role of the angle or position that a wave repeats with."""
        return next(role for role, _ in self.channels if role in TURNING)

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
            form = (self.effect.id, self.shape, names, self.odd, load, self.on_grid)
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
        return tuple(signal(run, channel, equation) for _, channel in self.channels)


def sources_at(layout: Layout, place: Place) -> Iterator[Source]:
    """Yield every candidate at a place."""
    repeats = repeats_one_reference(layout)
    for effect in catalogue().values():
        of_run_time = "clock" in effect.roles and effect.id.startswith(OVER_TIME)
        if not _acts(effect, place) or (repeats and of_run_time):
            continue
        options = [[(role, c) for c in place.roles.get(role, ())] for role in effect.roles]
        for channels in itertools.product(*options):
            if any(c not in layout.runs[0].channels for _, c in channels):
                continue
            if effect.id in SERIES and not _turns(layout, dict(channels)["position"]):
                continue
            odd = _follows_noise(layout, place, effect, channels)
            axes = [_axis(layout, place, effect, p, dict(channels)) for p in effect.shape]
            for shape in itertools.product(*axes):
                for parts in _parts(effect):
                    yield Source(place, effect, tuple(channels), shape, parts, odd)
            if effect.family in OF_ANY_ORDER:
                yield from _between(layout, Source(place, effect, tuple(channels), (), (), odd))


def _between(layout: Layout, wave: Source) -> Iterator[Source]:
    """Yield a wave at the orders that are not whole and that the error shows most."""
    angle = dict(wave.channels)[wave.turning]
    if not angle.endswith("_angle_rad"):
        return  # the periods of a position are on the grid
    factors = [channel for role, channel in wave.channels if role != wave.turning]
    least, most = least_order(layout, angle), _last_order(layout, wave.effect, angle)
    orders, tried = largest_orders(layout, wave.place.home, angle, factors, least, most)
    (parts,) = _parts(wave.effect)
    for order in orders:
        if not _is_whole_elsewhere(layout, wave.effect, angle, order):
            yield replace(wave, shape=(order,), parts=parts, tried=tried)


def _is_whole_elsewhere(layout: Layout, effect: Effect, angle: str, order: float) -> bool:
    """Whether an order of an angle is, within what the runs resolve, a whole one of another shaft.

    What turns with that shaft makes it then; no belt nor gear that nobody declared is needed.
    """
    return any(
        abs(there - round(there)) <= 2.0 * math.pi / travel_of(layout, other)
        for other, there in orders_elsewhere(layout, angle, order)
        if 0.5 < there <= _last_order(layout, effect, other)
    )


def _follows_noise(
    layout: Layout, place: Place, effect: Effect, channels: Sequence[tuple[str, str]]
) -> bool:
    """Whether an effect follows noise of a reading that is also in some equation's residual.

    An angle has so little noise that only a linear filter shows it.
    """
    readings = [c for _, c in channels if c in layout.measured]
    if effect.id.startswith(LOOPS) and effect.start() and place.kind == "deflection":
        readings = [c for c in readings if not c.endswith(ANGLES)]
    elif not effect.id.startswith(FILTERS):
        return False
    return any(
        (c, entry.equation) not in layout.independent for c in readings for entry in place.enters
    )


def repeats_one_reference(layout: Layout) -> bool:
    """Whether all runs repeat one motion, so that time within a run is the motion's phase."""
    angle = next((n for n in layout.measured if n.endswith(("_angle_rad", "_position_m"))), "")
    if not angle or len(layout.runs) < 2:
        return False
    size = min(len(r.channels[angle]) for r in layout.runs)
    # less the mean speed: shafts that turn one way have angles that grow alike
    moves = [detrend(r.channels[angle][:size]) for r in layout.runs]
    first = moves[0]
    return all(
        float(first @ m) > 0.99 * math.sqrt(float(first @ first) * float(m @ m)) for m in moves[1:]
    )


def _acts(effect: Effect, place: Place) -> bool:
    if effect.family in DECLARED_FRICTION or effect.id.startswith(DECLARED_ONLY):
        return False
    if effect.id in SYNONYMS:
        return False
    if effect.at_rest or effect.id == "coupling.torque":
        return False
    if not set(effect.roles) <= set(place.roles):
        return False
    kind = place.home.partition(".")[0]
    if (place.home, place.kind) == ("calibration.encoder", "deflection"):
        return False  # slower than a count a sample, the pattern of the counts passes for a bend
    if effect.family in OF_FEW and kind in KNOWN and kind not in effect.balances:
        return False  # a wrapped cable or a linkage, not a shaft in its bearings
    if (place.kind == "lever") != (effect.id == "eccentric.load.pulley"):
        return False
    if place.kind == "deflection" and effect.id.endswith(".lugre"):
        return False
    if place.kind == "loss":
        return not effect.id.startswith(NOT_A_LOSS)
    return effect.id.startswith(OF_KIND[place.kind])


def _parts(effect: Effect) -> list[tuple[int, ...]]:
    """Return the sets of columns that compete: all, and of a polynomial every part of it."""
    count = len(effect.amplitudes)
    everything = tuple(range(count))
    polynomial = effect.id.startswith(
        ("sensor.gain_nonlinear", "friction.position", "spring.position.curved")
    )
    if not polynomial:
        return [everything]
    return [p for k in range(1, count + 1) for p in itertools.combinations(everything, k)]


def _axis(
    layout: Layout, place: Place, effect: Effect, parameter: Parameter, channels: Mapping[str, str]
) -> list[float]:
    """Return the values of one shape parameter to try, over the range that the data cover."""
    if parameter.name == "width" and "speed" in effect.roles:
        usual = NARROW * _range(layout, channels["speed"])[1]
        return [direction_width(layout, place) or usual or 1.0]
    if parameter.name == "middle":
        return [0.0]  # play is crossed where the load changes its side
    if parameter.name == "harmonic":
        return _harmonics(layout, parameter, channels["position"])
    if parameter.name == "order":
        role = next(r for r in TURNING if r in channels)
        return _orders(layout, effect, channels[role])
    relative = RELATIVE.get((effect.id, parameter.name)) or RELATIVE.get(parameter.name)
    if effect.id == "friction.dwell" and relative is not None:
        return _rests(layout, parameter, channels, relative)
    if parameter.name == "fall" and relative is not None:
        # one that falls faster is another form of the change of sign
        usual = _range(layout, channels["speed"])[1] or 1.0
        least = max(relative[0], 2.0 * direction_width(layout, place) / usual)
        count = len(relative) if least < relative[-1] else 0
        relative = tuple(np.geomspace(least, relative[-1], count))
    if parameter.unit in channels and relative is not None:
        low, high = _range(layout, channels[parameter.unit])
        if parameter.linear:
            return [low + x * (high - low) for x in relative]
        scale = high if low == 0.0 else high - low
        return [float(scale * x) for x in relative]
    if relative is not None:
        return [float(x) for x in relative]
    return [float(x) for x in parameter.grid()[:: max(1, parameter.points // 5)]]


RELATIVE: Mapping[object, Sequence[float]] = {
    "fall": tuple(np.geomspace(0.03, 0.7, 7)),
    "reach": tuple(np.geomspace(0.002, 0.3, 9)),
    "knee": tuple(np.geomspace(0.1, 1.0, 5)),
    "width": tuple(np.geomspace(0.005, 0.05, 3)),
    "time": (0.15, 0.5, 1.5),
    "time_constant": (0.15, 0.5, 1.5),
    ("sensor.creep", "time_constant"): tuple(np.geomspace(0.03, 1.5, 5)),
    ("sensor.lag", "time_constant"): tuple(np.geomspace(2e-4, 5e-2, 6)),
    ("motor.electrical", "time_constant"): tuple(np.geomspace(1e-4, 5e-3, 4)),
    ("transmission.relaxation", "time"): tuple(np.geomspace(0.01, 0.7, 6)),
    ("transmission.relaxation.prony", "time"): (0.01, 0.05),
    ("friction.dwell", "time"): (0.03, 0.2),
    ("friction.dwell", "way"): (0.0025, 0.025),
    "delay": tuple(np.geomspace(2e-4, 5e-2, 6)),
    "since": tuple(np.linspace(0.08, 0.92, 12)),
    "onset": (0.3, 0.42, 0.54, 0.66, 0.78, 0.9),
    ("spring.end_stop.opening", "onset"): (0.1, 0.22, 0.34, 0.46, 0.58, 0.7),
    "settled": (0.0, 1.0),
    "rise": (0.5, 2.0),
    "exponent": (2.0 / 3.0, 1.5, 2.0),
    "sharpness": (2.0,),
    "wrap": (0.2, 1.0),
}
"""Shape parameter to the values tried, shares of the range of the channel that its unit names."""


def _rests(
    layout: Layout, parameter: Parameter, channels: Mapping[str, str], relative: Sequence[float]
) -> list[float]:
    """Return the times in which a contact ages, and the ways that wear it, that the runs show.

    A time is a share of a run, and at most the longest rest: without one the contact is always as
    its speed makes it, which is a friction that falls with the speed. A way is a share of that of a
    whole run at its usual most speed: a contact that is worn within less is a curve over speed too.
    """
    whole_s, speed = _range(layout, channels["clock"])[1], channels["speed"]
    if parameter.name == "way":
        return [x * whole_s * _range(layout, speed)[1] for x in relative]
    slowest = signals_of(layout).rest.get(speed, 0.0)
    rest_s = max(longest_rest_s(r.channels[speed], r.rate_hz, slowest) for r in layout.runs)
    return [x * whole_s for x in relative if x * whole_s <= rest_s]


def _harmonics(layout: Layout, parameter: Parameter, angle: str) -> list[float]:
    """Return the harmonics that some run turns a quarter of: over less, an inertia is constant."""
    if not angle.endswith("_angle_rad"):
        return []
    travel = travel_of(layout, angle)
    return [float(x) for x in parameter.grid() if x * travel > 0.5 * math.pi]


def _turns(layout: Layout, position: str) -> bool:
    """Whether a shaft makes a whole turn in some run."""
    return position.endswith("_angle_rad") and travel_of(layout, position) > 2.0 * math.pi


def least_order(layout: Layout, angle: str) -> float:
    """Return the least order that repeats: with fewer periods any smooth form looks like a wave."""
    return LEAST_PERIODS * 2 * math.pi / travel_of(layout, angle)


def _orders(layout: Layout, effect: Effect, angle: str) -> list[float]:
    """Return whole orders, as finely as the travel resolves them.

    A harmonic repeats with the shaft that makes it, so its order there is a whole number; of a
    shaft behind a belt or a gear it is another one, see `_between`.
    """
    resolved = 2 * math.pi / travel_of(layout, angle)
    if not angle.endswith("_angle_rad"):  # nothing turns: any period
        return list(np.arange(LEAST_PERIODS, MOST_PERIODS, 1.0 / 3.0) * resolved)
    first = max(1, math.ceil(least_order(layout, angle)))
    last = _last_order(layout, effect, angle)
    return [float(k) for k in range(first, last + 1, max(1, round(resolved / 3)))]


def _last_order(layout: Layout, effect: Effect, angle: str) -> int:
    resolved = 2 * math.pi / travel_of(layout, angle)
    return max(40, round(MOST_PERIODS * min(resolved, 1.5))) // (len(effect.amplitudes) // 2)


def _range(layout: Layout, channel: str) -> tuple[float, float]:
    """Return the range of a channel: of a speed or a clock from zero to its usual most."""
    if channel not in layout.ranges:
        inside = [run.on_grid(channel) for run in layout.runs]
        if "velocity" in channel:
            found = 0.0, float(np.median([np.percentile(np.abs(x), 95) for x in inside]))
        elif channel == "time_s":
            found = 0.0, float(np.median([x.max() for x in inside]))
        else:
            ends = np.array([np.percentile(x, [0.5, 99.5]) for x in inside])
            found = float(ends[:, 0].min()), float(ends[:, 1].max())
        layout.ranges[channel] = found
    return layout.ranges[channel]


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
    if source.odd:
        back = {r: x[::-1] if r not in CLOCKS else x[-1] - x[::-1] for r, x in seen.items()}
        columns = 0.5 * (columns - effect.columns(back, source.shape)[::-1])
    if not np.isfinite(columns).all():
        return None
    if source.is_wave:
        order = dict(zip((p.name for p in effect.shape), source.shape, strict=True))["order"]
        passed = _passed(run, names[roles.index(source.turning)], order)
        columns = columns * (passed[run.grid] if source.on_grid else passed)[:, None]
    return columns


def _bent(columns: FloatArray, bend: Bend) -> FloatArray:
    """Return columns and, after them, those of the first one's deviation from its equation."""
    inside = np.clip(columns[:, 0], bend.knots[0], bend.knots[-1])
    hats = [np.interp(inside, bend.knots, row) for row in np.eye(len(bend.knots))]
    return np.column_stack([columns, columns * np.array(hats).T])


def _passed(run: RunSignals, angle: str, order: float) -> FloatArray:
    """Return the gain that the channels' filter, forwards and backwards, has on a wave."""

    def turns_s() -> FloatArray:
        speed = np.abs(np.gradient(run.channels[angle])) * run.rate_hz
        return np.asarray(speed / (2.0 * math.pi))

    low_pass = run.low_pass
    relative = order * run.once(("turns", angle), turns_s) / low_pass.cutoff_hz
    return np.asarray(1.0 / (1.0 + relative ** (2 * low_pass.order)))


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
