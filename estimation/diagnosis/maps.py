"""Maps without a formula: the residual as a smooth function of one to three variables.

They compete with the catalogue. A map that predicts runs left out clearly better than a named
effect withdraws the name; where nothing in the catalogue fits, the map is the effect, and its
variables are what may be said.
"""

import itertools
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.derived import CABLE_ANGLE, CABLE_LOAD, MOTOR_LOAD, measured_channels
from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.design import Run
from estimation.diagnosis.endogeneity import noise_share
from estimation.diagnosis.evidence import chance, leave_one_run_out, runs_agree, surrogates
from estimation.diagnosis.instruments import FORCES
from estimation.effects.unknown_product import followed
from estimation.recording import FloatArray

CHANNELS = {
    "velocity_sign": "motor_velocity_rad_s",
    "velocity": "motor_velocity_rad_s",
    "spindle_angle": "spindle_angle_rad",
    "jaw_angle": "projected_jaw_angle_rad",
    "load": "projected_load_n_m",
    "current": "motor_current_a",
    "acceleration": "motor_acceleration_rad_s2",
    "time": "time_s",
    "motor_angle": "motor_angle_rad",
    "history": "spindle_angle_rad",
    "temperature": "motor_temperature_k",
    "wrist_pitch": "wrist_pitch_rad",
    "wrist_roll": "wrist_roll_rad",
}
"""Variables of a map, simplest first, and the channel each is taken from; of an arm see
`channels_of`."""

ARM_JOINTS = range(1, 8)

PROJECTED = {
    "proximal_torque_n_m": "projected_load_n_m",
    "jaw_angle_rad": "projected_jaw_angle_rad",
}
"""Measured channels, and what maps see of each: where it is the balance's own target, the declared
model's estimate stands in, since a sensor held against its own residual finds its own noise."""

SPEEDS = ("spindle_velocity_rad_s", "jaw_velocity_rad_s")
LOADS = ("proximal_torque_n_m", "distal_torque_n_m", MOTOR_LOAD, CABLE_LOAD)

BEHIND = {"motor": ("jaw_angle",), "gearbox": ("jaw_angle",), "cable": ("current",)}
"""Variables that reach a balance only through its load, and would stand for that load; and the
current in the cable's, where it tells the target: whatever the cable lacks is in it."""

ANGLES = {"spindle_angle", "jaw_angle", "motor_angle"}
"""Angles of one rig move together."""

OF_SPEED = ("viscous", "viscous_asymmetry", "drag", "stribeck", "load_viscous")
"""Frictions that go with the speed, not with its sign alone."""

KNOTS = 7
ORDERS = 8
PLAYS = (0.05, 0.2, 0.6)
"""Widths of the play operators that stand for history, shares of the middle 98 % of the range."""

RIDGE = 1e-3
THIN = 2
"""A map is slow in its variables: every second sample tells the same."""

NOISE_SHARE = 0.1
"""A map is none where this share of what it removes is the noise of a sensor of force."""

MOST_OF_NOISE = 20
"""Where so many of the best are made of noise, there is no map."""

SIMPLER = 0.07
"""A smaller subset is taken when its gain is this near to the best, pooled and in the median."""


@dataclass(frozen=True)
class Basis:
    """Columns that stand for one variable.

    Attributes:
        variable: Name from `CHANNELS`.
        channel: Where it is taken from.
        low: First percentile over the runs that discover.
        high: 99th percentile.
    """

    variable: str
    channel: str
    low: float
    high: float

    def columns(self, run: Run) -> FloatArray:
        """Return the columns of one whole run, shape (n, k); their span holds the constant."""
        x = run.channels[self.channel]
        span = self.high - self.low
        if self.variable == "velocity_sign":
            sign = np.tanh(x / (0.02 * span))
            return np.column_stack([np.ones(len(x)), sign])
        if self.variable == "motor_angle":
            waves = [f(k * x) for k in range(1, ORDERS + 1) for f in (np.sin, np.cos)]
            return np.column_stack([np.ones(len(x)), *waves])
        if self.variable == "history":
            plays = [play(x, share * span) for share in PLAYS]
            return np.column_stack([np.ones(len(x)), *plays])
        knots = np.linspace(self.low, self.high, KNOTS)
        return np.column_stack([np.interp(x, knots, row) for row in np.eye(KNOTS)])


@dataclass(frozen=True)
class Map:
    """A map of one or two variables, with the direction of motion or not, and the evidence for it.

    Attributes:
        bases: The variables.
        gain: Share of squared error removed on runs left out.
        median_gain: The same share in the median run.
        losses: Squared error of each run left out, shape (runs,).
        base_losses: The same without the map.
        p: Chance of such a gain from the best of all maps on surrogates.
        agree: Signed-rank p-value over the runs.
    """

    bases: tuple[Basis, ...]
    gain: float
    median_gain: float
    losses: FloatArray
    base_losses: FloatArray
    p: float = 1.0
    agree: float = 1.0

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the variables."""
        return tuple(basis.variable for basis in self.bases)

    def columns(self, run: Run) -> FloatArray:
        """Return the map's columns on one whole run, shape (n, k)."""
        return _products([basis.columns(run) for basis in self.bases])


def variables_of(effect: Candidate, balance: Balance) -> tuple[str, ...]:
    """Return the variables of a named effect in a balance, from the channels it reads."""
    known = channels_of(balance.model.balance, balance.runs[0].channels)
    # of two on one channel the last but history
    by_channel = {channel: name for name, channel in known.items() if name != "history"}
    by_channel |= dict.fromkeys(SPEEDS, "velocity") | dict.fromkeys(LOADS, "load")
    by_channel |= dict.fromkeys(("jaw_angle_rad", CABLE_ANGLE), "jaw_angle")
    for _, channel in effect.channels:
        if "_drive_" in channel:  # a motor behind the coupling of an arm's wrist
            by_channel[channel] = "motor_angle" if channel.endswith("_angle_rad") else "velocity"
    found = [by_channel[channel] for _, channel in effect.channels if channel in by_channel]
    kind, _, name = effect.family.partition(".")
    if kind == "friction" and name not in OF_SPEED:
        found = ["velocity_sign" if variable == "velocity" else variable for variable in found]
    if kind == "hysteresis":
        found.append("history")
    return tuple(dict.fromkeys(found))


def within(variables: Sequence[str], others: Collection[str]) -> bool:
    """Say whether variables are no more than others; the angles of one rig move together."""
    known = {*others, *(ANGLES if ANGLES & {*others} else ())}
    return {*variables} <= known


def best_map(
    balance: Balance,
    terms: Sequence[Candidate],
    count: int,
    seed: int,
    only: Collection[str] | None = None,
) -> Map | None:
    """Return the smallest map that is about as good as the best one.

    Args:
        balance: The balance.
        terms: Effects that are refitted beside the map.
        count: Number of surrogates.
        seed: Their seed.
        only: Variables to map over; None for all.
    """
    offered = [b for b in bases(balance) if only is None or b.variable in only]
    folds = stretches if balance.one_path else list
    base = folds([b[::THIN] for b in balance.base(terms)])
    left = folds([r[::THIN] for r in balance.left(terms)])
    drawn = surrogates(left, count, seed)
    aims = [np.column_stack([r, s]) for r, s in zip(left, drawn, strict=True)]
    singles = {basis: _thinned(balance, basis) for basis in offered}

    def tried(subset: tuple[Basis, ...]) -> tuple[Map, FloatArray]:
        parts = zip(*(singles[basis] for basis in subset), strict=True)
        columns = [_centred(_products(p), balance.demean) for p in parts]
        losses = leave_one_run_out(base, folds(columns), [columns[0].shape[1]], aims, RIDGE)
        joint, alone = losses.joint[:, 0, 0], losses.base[:, 0]
        ratio = joint / np.maximum(alone, np.finfo(float).tiny)
        gain, median = float(losses.gain[0, 0]), float(1 - np.median(ratio))
        made = Map(subset, gain, median, joint, alone, agree=runs_agree(alone, joint))
        return made, losses.gain[0, 1:]

    subsets = [*((b,) for b in offered), *itertools.combinations(offered, 2)]
    results = [tried(subset) for subset in subsets]
    results += [tried(subset) for subset in _with_direction(results, offered)]
    found = [made for made, _ in results]
    null = np.max([np.full(count, -np.inf), *(gains for _, gains in results)], axis=0)
    if not found or max(m.gain for m in found) <= 0:
        return None
    chosen = _simplest(found)
    for _ in range(MOST_OF_NOISE):
        if not _is_of_noise(balance, terms, chosen):
            break
        found.remove(chosen)
        if max((m.gain for m in found), default=0.0) <= 0:
            return None
        chosen = _simplest(found)
    else:
        return None
    return Map(
        chosen.bases,
        chosen.gain,
        chosen.median_gain,
        chosen.losses,
        chosen.base_losses,
        chance(chosen.gain, null),
        chosen.agree,
    )


def _is_of_noise(balance: Balance, terms: Sequence[Candidate], found: Map) -> bool:
    """Say whether a map tells a force in place of its sensor, without that sensor's noise."""
    if any(basis.channel in FORCES for basis in found.bases):
        return False  # it reads that sensor, noise and all
    parts = zip(*(_thinned(balance, basis) for basis in found.bases), strict=True)
    columns = [_centred(_products(part), balance.demean) for part in parts]
    return noise_share(balance, terms, columns, THIN) > NOISE_SHARE


def stretches(periods: Sequence[FloatArray]) -> list[FloatArray]:
    """Return as many stretches of a path as there are periods, each cut out of every period.

    On a path that repeats itself two positions tell where on the path one is: a map of them learns
    the residual by heart and knows it in every other period. Where stretches are left out, it has
    to predict what it has not seen.
    """
    longest, count = max(map(len, periods)), len(periods)
    ends = [longest * k // count for k in range(count + 1)]
    return [
        np.concatenate([period[first:last] for period in periods])
        for first, last in itertools.pairwise(ends)
    ]


def play(x: FloatArray, width: float) -> FloatArray:
    """Return the play operator of a signal: it follows when pulled by more than half its width."""
    offset: FloatArray = np.empty(len(x))
    followed(x, max(0.5 * width, np.finfo(float).tiny), np.nan, offset)
    return offset


def projection(balance: Balance) -> Callable[[Run], Run]:
    """Return what adds to a run's channels those that maps see in place of measured ones."""
    weights = balance.solve(balance.terms)

    def added(run: Run) -> Run:
        seen = {made: run.channels[own] for own, made in PROJECTED.items() if own in run.channels}
        if balance.model.target in PROJECTED:
            columns = np.column_stack([term.columns(run.channels) for term in balance.terms])
            seen[PROJECTED[balance.model.target]] = columns @ weights
        return replace(run, channels={**run.channels, **seen})

    return added


def channels_of(balance: str, there: Collection[str]) -> Mapping[str, str]:
    """Return the variables of a balance's maps, simplest first, and the channel of each.

    Args:
        balance: Balance id.
        there: Channels that the runs have; they tell whether a joint of an arm slides.
    """
    kind, _, number = balance.partition(".")
    if kind != "joint":
        return CHANNELS
    slides = {j for j in ARM_JOINTS if f"joint_{j}_position_m" in there}
    places = {j: f"joint_{j}_" + ("position_m" if j in slides else "angle_rad") for j in ARM_JOINTS}
    own = int(number)
    metres = own in slides
    speed = f"joint_{own}_velocity_" + ("m_s" if metres else "rad_s")
    return {
        "velocity_sign": speed,
        "velocity": speed,
        f"joint_{own}": places[own],
        "acceleration": f"joint_{own}_acceleration_" + ("m_s2" if metres else "rad_s2"),
        "time": "time_s",
        **{f"joint_{j}": places[j] for j in ARM_JOINTS if j != own},
        "history": places[own],
    }


def needed_channels(balance: str, measured: Sequence[str]) -> list[str]:
    """Return the channels of the variables that runs with these measured channels have."""
    variables = channels_of(balance, measured)
    wanted = [*PROJECTED, *(c for c in variables.values() if c not in PROJECTED.values())]
    return [c for c in wanted if set(measured_channels([c])) <= set(measured)]


def bases(balance: Balance) -> list[Basis]:
    """Return the variables that the balance's residual may be mapped over, simplest first."""
    found = []
    variables = channels_of(balance.model.balance, balance.runs[0].channels)
    for variable, channel in variables.items():
        if variable in BEHIND.get(balance.model.balance, ()):
            continue
        if balance.model.target in (channel, *measured_channels([channel])):
            continue  # the target tells its own residual, noise and all
        if any(channel not in run.channels for run in balance.runs):
            continue
        values = np.concatenate([run.channels[channel] for run in balance.runs])
        low, high = (float(v) for v in np.percentile(values, [1, 99]))
        if high - low > 1e-12 * max(abs(high), abs(low), 1e-12):
            found.append(Basis(variable, channel, low, high))
    return found


def _thinned(balance: Balance, basis: Basis) -> list[FloatArray]:
    return [run.thin(basis.columns(run))[::THIN] for run in balance.runs]


def _with_direction(
    results: Sequence[tuple[Map, FloatArray]], offered: Sequence[Basis]
) -> list[tuple[Basis, ...]]:
    """Return the best pair of variables with the direction beside it, where it lacks one."""
    sign = next((basis for basis in offered if basis.variable == "velocity_sign"), None)
    best = max((made for made, _ in results), key=lambda made: made.gain, default=None)
    if sign is None or best is None or len(best.bases) < 2:
        return []
    if {"velocity_sign", "velocity", "history"} & set(best.variables):
        return []
    return [(sign, *best.bases)]


def _products(parts: Sequence[FloatArray]) -> FloatArray:
    """Return the products of one column of each part, shape (n, columns)."""
    whole = parts[0]
    for part in parts[1:]:
        whole = np.asarray((whole[:, :, None] * part[:, None, :]).reshape(len(whole), -1))
    return whole


def _centred(columns: FloatArray, demean: bool) -> FloatArray:
    return columns - columns.mean(axis=0) if demean else columns


def _simplest(found: Sequence[Map]) -> Map:
    """Return the first single variable, else pair, near enough to the best."""
    best = max(found, key=lambda m: m.gain)
    near = [
        m
        for m in found
        if m.gain >= (1 - SIMPLER) * best.gain and m.median_gain >= (1 - SIMPLER) * best.median_gain
    ]
    fewest = min((len(m.bases) for m in near), default=len(best.bases))
    chosen = max((m for m in near if len(m.bases) == fewest), key=lambda m: m.gain, default=best)
    # the direction of motion is the simplest of the variables that hold it
    plain = {"velocity_sign" if v in ("velocity", "history") else v for v in chosen.variables}
    return next((m for m in near if set(m.variables) == plain), chosen)
