"""Compare a channel with the channel of the same recording that is its derivative.

With a wrong sample rate, scale, sign or a shifted column every number of a file is
plausible. Where a file holds both an angle and its velocity, the two expose it: over a span 2h the
displacement over time must be the mean of the velocity,

    (x(t + h) - x(t - h)) / 2h = ratio * mean of v(t + lag) over the span,   ratio = 1, lag = 0.

A velocity that a device filters lags by some milliseconds; it never leads.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.signal import correlate

from estimation.channels import unit_or_none
from estimation.recording import FloatArray, Recording
from rig.errors import DataError
from rig.importers.table.units import conversion

DERIVATIVE = {"rad": "rad/s", "rad/s": "rad/s^2", "m": "m/s", "m/s": "m/s^2", "N m": "N m/s"}
"""Unit of the derivative of a channel, by the channel's unit."""
QUANTITIES = ("angle", "position", "velocity", "speed", "rate", "acceleration", "torque")

CONFUSED = {
    "rad": ("deg", "rev"),
    "rad/s": ("rpm", "deg/s", "rev/s"),
    "rad/s^2": ("deg/s^2",),
    "m": ("mm", "cm", "in"),
    "m/s": ("mm/s", "cm/s", "m/min"),
    "m/s^2": ("mm/s^2",),
    "N m": ("mN m",),
    "N": ("mN", "kgf"),
    "A": ("mA",),
    "V": ("mV",),
    "Pa": ("kPa", "bar", "psi"),
    "1": ("%",),
    "N m/s": ("mN m/s",),
}
"""Unit of a channel to those that its values are often in instead."""

SPANS_S = (0.05, 0.2, 0.6)
"""Spans that are tried; the one with the highest correlation counts."""
LONGEST_S = 60.0
SEARCH_S = 1.0
LEAST_CORRELATION = 0.9
"""Below this, noise hides the relation and nothing is concluded."""
RATIO_TOLERANCE = 0.05
"""Measured velocities of an arm's joints agree with their angles within 0.017."""
LARGEST_LAG_S = 0.02
LARGEST_LAG_SAMPLES = 4
LARGEST_LEAD_SAMPLES = 2
"""Bounds of the lag; on the measured arm it is one sample of 5 ms."""
SHIFT_GAIN = 2.0
"""A shift must halve the unexplained variance: the start of a slow motion is poorly visible."""


@dataclass(frozen=True, slots=True)
class Relation:
    """How a channel's slope compares with its stated derivative."""

    ratio: float  # slope over derivative, negative where the signs differ; 1 is right
    lag_s: float  # time by which the derivative is late, s; negative where it is early
    lag_is_shift: bool  # whether the lag is too large for a filter
    correlation: float  # correlation of the two after the lag, 0 to 1

    def allows(self, ratio: float) -> bool:
        """Return whether the true ratio's size may be this one, by the noise in either channel."""
        size = abs(self.ratio) / ratio
        lowest, highest = size * self.correlation, size / self.correlation
        return highest >= 1 - RATIO_TOLERANCE and lowest <= 1 + RATIO_TOLERANCE


def checked(recording: Recording) -> Recording:
    """Return the recording if every channel agrees with the channel that is its derivative.

    Raises:
        DataError: A pair differs by a factor, a sign or a shift in time.
    """
    for name, slope_name in pairs(recording):
        if found := fault(recording, name, slope_name):
            raise DataError(
                f"{recording.source or recording.name}: {found}.",
                f"{slope_name} must be the time derivative of {name}. Either the sample rate, or a "
                "scale, a sign or the order of columns is wrong; nothing of it was imported.",
                "Correct the file, the mapping of its columns or the stated sample rate.",
            )
    return recording


def fault(recording: Recording, name: str, slope_name: str) -> str:
    """Return how a channel and its stated derivative differ, in words; nothing if they agree."""
    found = relation(recording, name, slope_name)
    if found is None:
        return ""
    if found.lag_is_shift:
        way = "after" if found.lag_s > 0 else "before"
        return f"{slope_name} comes {abs(1000 * found.lag_s):.0f} ms {way} the motion of {name}"
    if found.ratio < 0:
        return f"{slope_name} has the opposite sign of the motion of {name}"
    if not found.allows(1.0):
        units = "".join(f"{unit}, or " for unit in _units(found, name, slope_name))
        return (
            f"{name} changes {found.ratio:.3g} times as fast as {slope_name} states; {units}a"
            " sample rate that is wrong by this factor would explain it"
        )
    return ""


def _units(found: Relation, name: str, slope_name: str) -> Iterator[str]:
    """Yield the wrong units that would explain a ratio, as the channel and its unit."""
    for channel, way in ((slope_name, 1), (name, -1)):
        for unit in CONFUSED.get(unit_or_none(channel) or "", ()):
            size = conversion(unit, channel)
            factor = size.factor**way if size else 1.0
            if found.allows(factor):
                yield f"{channel} in {unit}"
            elif found.allows(1 / factor):
                yield f"{channel} stated in {unit} without being so"


def pairs(recording: Recording) -> Iterator[tuple[str, str]]:
    """Yield each channel that has its derivative in the recording, and the derivative's name."""
    units: dict[str, dict[str, list[str]]] = {}
    for name in recording.columns:
        stem, unit = _stem(name)
        units.setdefault(stem, {}).setdefault(unit, []).append(name)
    for by_unit in units.values():
        for unit, names in by_unit.items():
            for slope_name in by_unit.get(DERIVATIVE.get(unit, ""), []):
                for name in names:
                    yield name, slope_name


def _stem(name: str) -> tuple[str, str]:
    """Return the part and the unit of a channel: `joint_1`, `rad` of `joint_1_angle_rad`."""
    unit = unit_or_none(name)
    if unit is None:
        return name, ""
    parts = name.split("_")
    last = max((i for i, part in enumerate(parts) if part in QUANTITIES), default=None)
    return "_".join(parts[:last]) if last is not None else name, unit


def relation(recording: Recording, name: str, slope_name: str) -> Relation | None:
    """Compare a channel's slope with its stated derivative on the longest unbroken part.

    Returns None where noise hides the relation or the run is too short.
    """
    if len(recording) < 2:
        return None
    part = _unbroken(recording)
    period_s = 1 / recording.sample_rate_hz
    value, slope = recording[name][part], recording[slope_name][part]
    integral = np.concatenate([[0.0], np.cumsum((slope[1:] + slope[:-1]) / 2)]) * period_s
    best: Relation | None = None
    for span_s in SPANS_S:
        half = max(1, round(span_s / 2 / period_s))
        if value.size < 8 * half or value.size < 50:
            continue
        width = 2 * half * period_s
        found = _aligned(
            (value[2 * half :] - value[: -2 * half]) / width,
            (integral[2 * half :] - integral[: -2 * half]) / width,
            period_s,
        )
        if best is None or found.correlation > best.correlation:
            best = found
    return best if best is not None and best.correlation >= LEAST_CORRELATION else None


def _unbroken(recording: Recording) -> slice:
    """Return the longest stretch of valid samples without a gap, at most `LONGEST_S` of it."""
    step_s = 1 / recording.sample_rate_hz
    broken = np.diff(recording.time_s) > 1.5 * step_s
    edges = np.flatnonzero(broken | ~recording.valid[1:] | ~recording.valid[:-1]) + 1
    edges = np.concatenate([[0], edges, [len(recording)]])
    longest = int(np.argmax(np.diff(edges)))
    start, stop = int(edges[longest]), int(edges[longest + 1])
    return slice(start, min(stop, start + round(LONGEST_S / step_s)))


def _aligned(moved: FloatArray, stated: FloatArray, period_s: float) -> Relation:
    """Compare two velocities at the lag at which they correlate best."""
    moved, stated = moved - moved.mean(), stated - stated.mean()
    scale = float(np.sqrt((moved @ moved) * (stated @ stated)))
    if scale <= 0:
        return Relation(1.0, 0.0, False, 0.0)
    reach = min(max(round(SEARCH_S / period_s), 2 * LARGEST_LAG_SAMPLES), moved.size // 4)
    middle = moved.size - 1
    correlations = correlate(stated, moved)[middle - reach : middle + reach + 1] / scale
    lags = np.arange(-reach, reach + 1)
    late = max(LARGEST_LAG_SAMPLES, LARGEST_LAG_S / period_s)
    usual = (lags >= -LARGEST_LEAD_SAMPLES) & (lags <= late)
    lag = int(lags[usual][np.argmax(np.abs(correlations[usual]))])
    best = int(lags[np.argmax(np.abs(correlations))])
    inside, outside = _overlap(moved, stated, lag), _overlap(moved, stated, best)
    if 1 - inside[0] ** 2 > SHIFT_GAIN * (1 - outside[0] ** 2):
        lag, inside = best, outside
    correlation, ratio = inside
    shifted = not -LARGEST_LEAD_SAMPLES <= lag <= late
    return Relation(ratio, lag * period_s, shifted, abs(correlation))


def _overlap(moved: FloatArray, stated: FloatArray, lag: int) -> tuple[float, float]:
    """Return correlation and signed ratio of spread where the two overlap at a lag."""
    a = moved[max(0, -lag) : moved.size - max(0, lag)]
    b = stated[max(0, lag) : stated.size - max(0, -lag)]
    a, b = a - a.mean(), b - b.mean()
    correlation = float(a @ b / np.sqrt((a @ a) * (b @ b)))
    return correlation, float(np.copysign(np.sqrt((a @ a) / (b @ b)), correlation))
