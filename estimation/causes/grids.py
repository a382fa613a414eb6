"""The values of an effect's shape that a search tries.

They follow the data: a speed is searched over the speeds there are, a travel over the travel. An
effect that is not distinguishable from a simpler one over that range has none.
"""

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np

from estimation.causes.angles import signals_of, travel_of
from estimation.causes.layout import Layout
from estimation.causes.places import Place
from estimation.effects import Effect, Parameter, Waves
from estimation.rest import longest_rest_s

NARROW = 0.02
"""Speed over which friction changes its sign where none is declared, share of the usual most."""

LEAST_PERIODS, MOST_PERIODS = 2.0, 60.0
"""Periods of a harmonic that some run must cover: fewer are a slow change with the angle."""


STEPS = (-0.5, -0.25, 0.25, 0.5)
"""Values between the points of a grid, in its steps."""

CONTACT = ("time", "way")
"""Shape parameters of friction that depends on dwell: the ageing of a contact, and its wear."""


def axis(
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
    if isinstance(effect, Waves):
        return _orders(layout, effect, channels[effect.turning])
    relative = RELATIVE.get((effect.id, parameter.name)) or RELATIVE.get(parameter.name)
    if effect.id == "friction.dwell" and relative is not None:
        return _rests(layout, parameter.name, channels, relative)
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


def contacts(layout: Layout, channels: Mapping[str, str]) -> list[tuple[float, float]]:
    """Return times in which a contact ages and ways that wear it; none where no run rests."""
    time_s, way = (
        _rests(layout, name, channels, RELATIVE["friction.dwell", name]) for name in CONTACT
    )
    return list(itertools.product(time_s, way))


def next_to(contact: tuple[float, float]) -> list[tuple[float, float]]:
    """Return the time and the way of a contact with one of them between the points of its grid."""
    time_s, way = contact
    times, ways = (
        between(RELATIVE["friction.dwell", name], value)
        for name, value in zip(CONTACT, contact, strict=True)
    )
    return [(x, way) for x in times] + [(time_s, x) for x in ways]


def between(relative: Sequence[float], value: float, linear: bool = False) -> list[float]:
    """Return values next to one, nearer than the points of its grid are to one another."""
    if linear:
        return [value + step * (relative[1] - relative[0]) for step in STEPS]
    return [value * (relative[1] / relative[0]) ** step for step in STEPS]


def _rests(
    layout: Layout, name: str, channels: Mapping[str, str], relative: Sequence[float]
) -> list[float]:
    """Return the times in which a contact ages, or the ways that wear it, that the runs show.

    A time is a share of a run, and at most the longest rest: without one the contact is always as
    its speed makes it, which is a friction that falls with the speed. A way is a share of that of a
    whole run at its usual most speed: a contact that is worn within less is a curve over speed too.
    """
    whole_s, speed = _range(layout, channels["clock"])[1], channels["speed"]
    if name == "way":
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


def turns(layout: Layout, position: str) -> bool:
    """Whether a shaft makes a whole turn in some run."""
    return position.endswith("_angle_rad") and travel_of(layout, position) > 2.0 * math.pi


def has_both_signs(layout: Layout, channel: str) -> bool:
    """Whether a reading goes to either side, to the lesser one a tenth as far or more."""
    low, high = _range(layout, channel)
    return min(high, -low) > 0.1 * max(high, -low)


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
    last = last_order(layout, effect, angle)
    return [float(k) for k in range(first, last + 1, max(1, round(resolved / 3)))]


def order_step(layout: Layout, position: str) -> float:
    """Return the least step between orders: a whole one of a shaft, else what the travel resolves.

    Where nothing turns, a twelfth of an order that the travel resolves: a wave of the next order is
    at most by an eighth of a period apart at the ends of the travel.
    """
    turns = position.endswith("_angle_rad")
    return 1.0 if turns else math.pi / (6.0 * travel_of(layout, position))


def last_order(layout: Layout, effect: Effect, angle: str) -> int:
    """Return the largest order that a search tries: more where the travel resolves few."""
    resolved = 2 * math.pi / travel_of(layout, angle)
    return max(40, round(MOST_PERIODS * min(resolved, 1.5))) // (len(effect.amplitudes) // 2)


def direction_width(layout: Layout, place: Place) -> float:
    """Return the speed over which friction at a place changes its sign, 0.0 where none is declared.

    Where its own equation has none of that speed, that of another one, at the same share of the
    usual speed of its shaft.
    """
    (speed,), own = place.roles["speed"], layout.equations[place.home]
    if own.width and own.speed == speed:
        return own.width
    usual = _range(layout, speed)[1]
    declared = [e for e in layout.equations.values() if e.width]
    shares = [e.width / (_range(layout, e.speed)[1] or usual) for e in declared]
    return max(shares, default=0.0) * usual


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
