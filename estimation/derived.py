"""Derived channels: speeds, accelerations, combinations of a machine's channels.

A derived channel is requested by name. `X_velocity_rad_s` and `X_acceleration_rad_s2` are the first
and second derivative of `X_angle_rad`, and so in metres of `X_position_m`; `X_rate_n_m_s` is the
first of `X_n_m`; `X_travel_rad` is the increase of that angle since its lowest value of the last
`TRAVEL_WINDOW_S`, the state of hysteresis after a reversal, and `X_turned_s` the time since that
value; `X_rise_a` is the increase of the channel `X_a` (any unit) since the motor's angle was
lowest, and `X_fall_a` its difference to its highest value of that window; `X_20ms_ago_a` is its
value 20 ms earlier, `X_acceleration_20ms_ago_rad_s2` the derivative at that time; a machine's own
combinations of channels, such as the bend of its gearbox, are in `estimation.signals`;
`campaign_time_s` is the time since the campaign's first run began, added to the measured channels
by `Campaign.timed`, and live the time since the first sample. Offline they come from a zero-phase
filter and a noise-robust derivative, live from a causal filter and backward differences: the same
names, two sources.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimation.channels import ending_of
from estimation.filters import PAPER, LowPass, fill_gaps, filter_recording, holoborodko_derivative
from estimation.plant import ACCELERATION, POSITION, SPEED
from estimation.recording import FloatArray, Recording
from estimation.rest import SPINDLE_SPEED, closing, in_motion
from estimation.signals import Combination, Samples, Signals, reference

CAMPAIGN_TIME = "campaign_time_s"
"""Time since the campaign's first run began; a clock, so no filter touches it."""

MOTION = {POSITION[unit]: (SPEED[unit], ACCELERATION[unit]) for unit in POSITION}
"""Ending of an angle or a position to those of its speed and its acceleration."""

RATES = {**MOTION, "_n_m": ("_rate_n_m_s",)}
"""Ending of a channel to those of its derivatives, the first one first."""

TRAVEL, TURNED, FALL, RISE = "_travel_rad", "_turned_s", "_fall_", "_rise_"
AGO = re.compile(r"^(?P<name>.+)_(?P<ms>\d+)ms_ago(?P<unit>_.+)$")

TURNING = "motor_angle_rad"
"""The angle whose lowest value is where the drive last turned."""

TRAVEL_WINDOW_S = 0.5
"""Window of a travel, s. A longer memory could identify the run."""

ALIKE = 1e-9
"""Values that differ by less are alike where the place of the lowest matters. A filtered angle at
rest differs by its rounding, which is another one for samples one by one, in batches, or in C."""

CLOCKS = ("time_s", CAMPAIGN_TIME)

Operator = Callable[[FloatArray], FloatArray]


def measured_channels(names: Iterable[str], signals: Signals | None = None) -> tuple[str, ...]:
    """Return the measured channels that the named channels are computed from, sorted.

    Without signals of a machine they are the reference rig's, here and in the functions below.
    """
    needed: set[str] = set()
    known = signals or reference()
    for name in names:
        if (combination := known.combination(_source(name, known)[0])) is not None:
            needed |= {*measured_channels((s.channel for s in combination.shares), known)}
            if combination.direction is not None:
                needed.add(origin_of(combination.direction.speed)[0])
        elif name != "time_s":
            now, kind = now_of(name)
            needed.add(now if kind in (FALL, RISE) else origin_of(now)[0])
            needed |= {TURNING} if kind == RISE else set()
    return tuple(sorted(needed))


def now_of(name: str) -> tuple[str, str]:
    """Return the channel that a channel of the past is computed from, and of which kind it is.

    The kind is the part of its name that states it, or the milliseconds ago; empty of the present.
    """
    for kind in (TRAVEL, TURNED):
        if name.endswith(kind):
            return name.removesuffix(kind) + "_angle_rad", kind
    for kind in (FALL, RISE):
        if kind in name:
            return name.replace(kind, "_"), kind
    if (ago := AGO.match(name)) is not None:
        return ago["name"] + ago["unit"], ago["ms"]
    return name, ""


def fall_of(channel: str) -> str:
    """Return the name of a measured channel's fall: `motor_current_fall_a`."""
    return FALL.join(_parted(channel))


def rise_of(channel: str) -> str:
    """Return the name of a measured channel's rise: `motor_current_rise_a`."""
    return RISE.join(_parted(channel))


def ago_of(channel: str, ms: int) -> str:
    """Return the name of a measured channel's value some time ago: `motor_current_20ms_ago_a`."""
    return f"_{ms}ms_ago_".join(_parted(channel))


def _parted(channel: str) -> tuple[str, str]:
    suffix = ending_of(channel)
    return channel.removesuffix(f"_{suffix}"), suffix


def origin_of(name: str) -> tuple[str, int]:
    """Return the channel a channel is the derivative of, and how many times."""
    for ending, rates in RATES.items():
        for times, rate in enumerate(rates, start=1):
            if name.endswith(rate):
                return name.removesuffix(rate) + ending, times
    return name, 0


def rates_of(position: str) -> tuple[str, ...]:
    """Return the names of the speed and the acceleration of an angle or a position; else none."""
    for ending, rates in MOTION.items():
        if position.endswith(ending):
            return tuple(position.removesuffix(ending) + rate for rate in rates)
    return ()


def _source(name: str, signals: Signals) -> tuple[str, int]:
    """Return the channel or combination a channel is the derivative of, and how many times."""
    return origin_of(name) if signals.combination(name) is None else (name, 0)


def derive(
    filtered: Mapping[str, FloatArray],
    names: Iterable[str],
    sample_rate_hz: float,
    derivative: Operator,
    signals: Signals,
    tracked: Mapping[str, FloatArray] | None = None,
) -> dict[str, FloatArray]:
    """Return the named channels, from filtered measured ones without gaps.

    `tracked` is an angle to itself and its two derivatives, shape (n, 3), where they are known.
    """
    window = window_samples(sample_rate_hz)

    @cache
    def differentiated(name: str) -> FloatArray:
        source, times = _source(name, signals)
        if times and tracked and source in tracked:
            return tracked[source][:, times]
        made = signals.combination(source)
        values = filtered[source] if made is None else combined(made, differentiated)
        for _ in range(times):
            values = derivative(values)
        return values

    channels: dict[str, FloatArray] = {}
    for name in names:
        now, kind = now_of(name)
        if kind == TRAVEL:
            channels[name] = since_lowest(filtered[now], window)
        elif kind == TURNED:
            back = np.arange(len(filtered[now])) - lowest(filtered[now], window, ALIKE)
            channels[name] = back / sample_rate_hz
        elif kind == FALL:
            channels[name] = since_lowest(-filtered[now], window)
        elif kind == RISE:
            turned = lowest(filtered[TURNING], window, ALIKE)
            channels[name] = filtered[now] - filtered[now][turned]
        elif kind:
            channels[name] = _delayed(differentiated(now), kind, sample_rate_hz)
        else:
            channels[name] = differentiated(name)
    return channels


def combined(
    combination: Combination,
    differentiated: Callable[[str], FloatArray],
) -> FloatArray:
    """Return a combination of channels, each as a function of its name gives it, shape (n,)."""
    parts = [s.times * differentiated(s.channel) / s.over for s in combination.shares]
    if (turn := combination.direction) is not None:
        parts.append(turn.size * np.tanh(differentiated(turn.speed) / turn.width))
    return np.asarray(sum(parts[1:], start=parts[0]))


def _delayed(values: FloatArray, ms: str, sample_rate_hz: float) -> FloatArray:
    """Return the values of so many ms ago; before the first one, the first one."""
    back = round(1e-3 * int(ms) * sample_rate_hz)
    return values[np.maximum(np.arange(len(values)) - back, 0)]


def settled_places(
    channels: Recording,
    low_pass: LowPass,
    step: int = 1,
    samples: Samples = "all",
    signals: Signals | None = None,
) -> NDArray[np.intp]:
    """Return the places of every `step`-th sample that is valid and away from the ends of its run.

    At the ends the filter works on a reflection of the run, and a second derivative shows it. The
    channels are those of one whole run, filtered; motion is determined from the speeds among them.
    """
    edge = int(np.ceil(2 * low_pass.reach_s * channels.sample_rate_hz))
    inner = channels.valid.copy()
    inner[:edge] = False
    inner[max(len(inner) - edge, 0) :] = False
    if samples == "motion":
        valid = inner.copy()
        for speed, slowest in (signals or reference()).rest.items():
            if speed in channels:
                inner &= in_motion(channels[speed], valid, channels.sample_rate_hz, slowest)
    if samples == "closing":
        inner &= closing(channels[SPINDLE_SPEED], channels.sample_rate_hz)
    return np.flatnonzero(inner)[::step]


def zero_phase_channels(
    recording: Recording,
    names: Iterable[str],
    low_pass: LowPass = PAPER,
    signals: Signals | None = None,
) -> Recording:
    """Return a recording of the named channels, filtered without lag and differentiated.

    Channels are measured or derived; `time_s` is always there.

    Raises:
        MissingChannelError: A measured channel is not in the recording.
        FilterError: The run cannot be filtered.
    """
    names = list(dict.fromkeys(names))
    signals = signals or reference()
    clocks = {name: recording[name] for name in names if name == CAMPAIGN_TIME}
    wanted = [name for name in names if name not in CLOCKS]
    if not wanted:
        return replace(recording, columns=clocks)
    measured = {name: recording[name] for name in measured_channels(wanted, signals)}
    filtered = filter_recording(replace(recording, columns=measured), low_pass)
    period_s = 1.0 / recording.sample_rate_hz
    ticks = recording.ticks
    whole = {
        name: _on_time(
            np.asarray(fill_gaps(ticks, values[:, None])[:, 0]), name, recording, signals
        )
        for name, values in filtered.columns.items()
    }
    derived = derive(
        whole,
        wanted,
        recording.sample_rate_hz,
        lambda values: np.asarray(holoborodko_derivative(values, period_s)),
        signals,
    )
    columns = {name: values[ticks] for name, values in derived.items()}
    return replace(filtered, columns=columns | clocks)


def _on_time(values: FloatArray, name: str, recording: Recording, signals: Signals) -> FloatArray:
    """Return a filtered channel as its sensor would have read it without delay."""
    known = signals.readings.get(name)
    late = 0.0 if known is None else known.age_s(recording.sample_rate_hz)
    if late == 0.0:
        return values
    at = np.arange(len(values))
    return np.asarray(np.interp(at + late * recording.sample_rate_hz, at, values))


def looks_back(names: Iterable[str]) -> bool:
    """Whether a channel needs the samples of the last `TRAVEL_WINDOW_S`."""
    return any(now_of(name)[1] for name in names)


def differentiated_from(names: Iterable[str]) -> set[str]:
    """Return the channels that the named channels, or those of their past, are derivatives of."""
    origins = (origin_of(now_of(name)[0]) for name in names)
    return {source for source, times in origins if times}


def window_samples(sample_rate_hz: float) -> int:
    """Return the number of samples in the window of a travel."""
    return max(1, round(TRAVEL_WINDOW_S * sample_rate_hz))


def since_lowest(values: FloatArray, window: int) -> FloatArray:
    """Return each value less the lowest of itself and the `window - 1` before it."""
    return np.asarray(values - values[lowest(values, window)])


@njit(cache=True)
def lowest(values: FloatArray, window: int, alike: float = 0.0) -> NDArray[np.int64]:
    """Return the place of the lowest of each value and the `window - 1` before it.

    Of those that differ by no more than `alike` it is the last. Values that rise are kept in a
    queue, so each one is looked at twice at the most.
    """
    found = np.empty(len(values), np.int64)
    queue = np.empty(len(values), np.int64)
    first, end = 0, 0
    for i in range(len(values)):
        while end > first and values[queue[end - 1]] >= values[i] - alike:
            end -= 1
        queue[end] = i
        end += 1
        if queue[first] <= i - window:
            first += 1
        found[i] = queue[first]
    return found
