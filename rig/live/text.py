"""The words of the display: numbers with their unit, or why a number is missing.

SI ends here: small torques are shown in mN m and angles in degrees, small ones in mrad, to people
only.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from estimation.channels import describe
from rig.live.block import LimitStatus
from rig.live.options import ShowOptions
from rig.live.state import Reading, Snapshot, Summary, Value

SHOWN = {"N m": (1e3, "mN m", 1), "rad": (180 / math.pi, "deg", 2), "N": (1.0, "N", 2)}
"""SI unit to its factor, name and decimals on the display."""

LARGE, SMALL = {"N m": (1.0, (1.0, "N m", 3))}, {"rad": (0.01, (1e3, "mrad", 3))}
"""SI unit to the size from which, or below which, values are shown otherwise, and how."""

NAMES = {
    "distal_torque_n_m": "Grip torque",
    "proximal_torque_n_m": "Spindle torque",
    "grasp_force_n": "Grasp force",
    "pitch_force_n": "Pitch force",
    "yaw_force_n": "Yaw force",
    "jaw_1_force_n": "Jaw 1 force",
    "jaw_2_force_n": "Jaw 2 force",
}

TIP_CHANNEL = "distal_torque_n_m"
"""The torque that a lever arm turns into the force at the jaw tip."""

STATES = {
    "ok": ("●", "good"),
    "armed": ("●", "good"),
    "disarmed": ("○", "quiet"),
    "on": ("●", "bad"),
    "off": ("○", "quiet"),
    "stale": ("▲", "warning"),
    "suspect": ("▲", "warning"),
    "fault": ("✖", "bad"),
}
"""State of a device to its symbol and style, so that no state is shown by colour alone."""


def in_shown_unit(unit: str, size: float = math.nan) -> tuple[float, str, int]:
    """Return the factor from SI, the unit's name and the decimals of values of a size."""
    if unit in LARGE and abs(size) >= LARGE[unit][0]:
        return LARGE[unit][1]
    if unit in SMALL and abs(size) < SMALL[unit][0]:
        return SMALL[unit][1]
    return SHOWN.get(unit, (1.0, unit, 3))


def size_of(reading: Reading) -> float:
    """Return the largest size in the last 10 s: all numbers of a reading have one unit."""
    recent = np.abs([*reading.estimate_trace.flat, *reading.sensor_trace.flat])
    return float(np.nanmax(recent)) if np.isfinite(recent).any() else math.nan


def name_of(channel: str) -> str:
    """Return the common name of a channel."""
    return NAMES.get(channel) or describe(channel).description.capitalize()


def digits(value: Value, unit: str, size: float | None = None) -> str | None:
    """Return the number alone in the display's unit, or None when there is none.

    The unit is that of values of a size, by default the value's own.
    """
    if value.number is None:
        return None
    factor, _, decimals = in_shown_unit(unit, value.number if size is None else size)
    # adding zero turns -0.0 into 0.0
    return f"{round(value.number * factor, decimals) + 0.0:.{decimals}f}"


def with_unit(value: Value, unit: str, size: float | None = None) -> str:
    """Return the number with its unit, or `no value` and the reason; see `digits`."""
    if value.number is None:
        return f"no value ({value.missing})"
    shown = in_shown_unit(unit, value.number if size is None else size)
    return f"{digits(value, unit, size)} {shown[1]}"


def tip_force_n(reading: Reading, lever_m: float) -> float | None:
    """Return the force at the jaw tip, N, or None without a value or a lever.

    Grip force is jaw torque over the lever arm (O'Neill et al. 2018 measured 12 mm).
    """
    if reading.channel != TIP_CHANNEL or reading.main.number is None:
        return None
    return reading.main.number / lever_m


def main_words(reading: Reading, options: ShowOptions) -> str:
    """Return the main value with its unit, an estimate with its 95 % interval where it is known."""
    main = with_unit(reading.main, reading.unit, size_of(reading))
    return f"{main}{interval(reading, options, ' ±')}"


def interval(reading: Reading, options: ShowOptions, sign: str = "±") -> str:
    """Return the 95 % interval of an estimate in words; empty where it is not known."""
    half_width = options.half_widths().get(reading.channel)
    if not reading.has_estimator or reading.main.number is None or half_width is None:
        return ""
    return f"{sign}{with_unit(Value(half_width), reading.unit, size_of(reading))}"


def error_rms(reading: Reading) -> str:
    """Return the error of the estimate against the sensor in words."""
    if reading.error_rms is None:
        return "error unknown"
    error = with_unit(Value(reading.error_rms), reading.unit, size_of(reading))
    return f"error rms {error} in 5 s"


def notes(reading: Reading, options: ShowOptions) -> Iterator[str]:
    """Yield three notes on the main number: the force at the tip, the sensor, the error."""
    force_n = tip_force_n(reading, options.lever_m)
    lever = f"at the jaw tip (lever {options.lever_m * 1e3:g} mm)"
    if reading.channel != TIP_CHANNEL:
        yield ""
    else:
        yield f"no force {lever}" if force_n is None else f"{force_n:.2f} N {lever}"
    if not reading.has_estimator:
        yield from ("no estimator", "")
        return
    yield f"sensor {with_unit(reading.sensor, reading.unit, size_of(reading))}"
    yield error_rms(reading)


def rate(snapshot: Snapshot) -> str:
    """Return the sample rate in words."""
    rate_hz = snapshot.sample_rate_hz
    return "rate unknown" if rate_hz is None else f"{rate_hz:.0f} Hz"


def lost(count: int, received: int) -> str:
    """Return the samples lost in words, with their share where there are any."""
    if not count:
        return "lost 0"
    return f"LOST {count} ({100 * count / (count + received):.2g} %)"


def flagged(counts: Mapping[str, int]) -> str:
    """Return the flags seen in words; empty when there are none."""
    return ", ".join(f"{name} {count}" for name, count in counts.items())


def limit_share(limit: LimitStatus) -> float | None:
    """Return how much of the limit is used, 1 at the limit, or None when that is unknown."""
    share = abs(limit.value) / limit.limit if limit.limit > 0 else math.nan
    return share if math.isfinite(share) else None


def limit_words(limit: LimitStatus) -> tuple[str, str]:
    """Return a limit in numbers, with a word when it is near or reached, and its style."""
    share = limit_share(limit)
    most = with_unit(Value(limit.limit), limit.unit)
    if share is None:
        return f"no value, limit {most}", "bad"
    text = f"{digits(Value(limit.value), limit.unit, limit.limit)} of {most}, {100 * share:.0f} %"
    if share >= 1:
        return f"{text} AT LIMIT", "bad"
    return (f"{text} near", "warning") if share >= 0.8 else (text, "good")


def summary_lines(summary: Summary, unit: str) -> list[str]:
    """Return the summary of a whole stream, in lines."""
    how = {"finished": "Finished", "interrupted": "Stopped"}.get(summary.ended, "Ended")
    lines = [
        f"{how} after {summary.duration_s:.1f} s: {summary.samples} samples, "
        f"{lost(summary.lost, summary.samples)}."
    ]
    if summary.flagged:
        lines.append(f"Flagged samples: {flagged(summary.flagged)}.")
    if summary.error_rms is not None:
        lines.append(
            f"{name_of(summary.channel)}, estimate against sensor: rms error "
            f"{with_unit(Value(summary.error_rms), unit)} over {summary.error_samples} samples,"
            " those at standstill too."
        )
    if summary.inside_rms is not None and summary.inside_samples < summary.error_samples:
        lines.append(
            f"Within what it was fitted on: {with_unit(Value(summary.inside_rms), unit)} over "
            f"{summary.inside_samples} of these samples."
        )
    return lines


def plain_line(snapshot: Snapshot, options: ShowOptions) -> str:
    """Return one line on a snapshot, for logs and for terminals that cannot draw."""
    parts = ["no samples yet" if snapshot.time_s is None else f"{snapshot.time_s:8.1f} s"]
    for reading in snapshot.readings:
        shown = main_words(reading, options)
        parts.append(f"{name_of(reading.channel)}, {reading.source} {shown}")
        force_n = tip_force_n(reading, options.lever_m)
        if force_n is not None:
            parts.append(f"{force_n:.2f} N at {options.lever_m * 1e3:g} mm")
        if reading.has_estimator:
            sensor = with_unit(reading.sensor, reading.unit, size_of(reading))
            parts.append(f"sensor {sensor}")
            parts.append(error_rms(reading))
    parts += [rate(snapshot), lost(snapshot.lost, snapshot.samples)]
    parts += [f"{device.name} {device.state}" for device in snapshot.devices]
    limits = {limit.name: limit_words(limit) for limit in snapshot.limits}
    parts += [f"{name} {text}" for name, (text, style) in limits.items() if style != "good"]
    parts += [f"flagged: {flagged(snapshot.flagged)}"] if snapshot.flagged else []
    return " | ".join(parts)


def json_frame(snapshot: Snapshot, options: ShowOptions) -> dict[str, Any]:
    """Return a snapshot as plain types, SI units.

    `channels` maps each watched channel to its values; a value that is null has its reason next
    to it. Traces are left out: the reader has every frame.
    """
    return {
        "kind": "frame",
        "time_s": snapshot.time_s,
        "samples": snapshot.samples,
        "lost": snapshot.lost,
        "sample_rate_hz": snapshot.sample_rate_hz,
        "flagged": snapshot.flagged,
        "lever_m": options.lever_m,
        "estimate_half_width95": options.half_widths().get(snapshot.readings[0].channel),
        "channels": {r.channel: _json_reading(r, options) for r in snapshot.readings},
        "devices": snapshot.devices,
        "limits": snapshot.limits,
    }


def _json_reading(reading: Reading, options: ShowOptions) -> dict[str, Any]:
    found: dict[str, Any] = {
        "unit": reading.unit,
        "estimate": reading.estimate.number,
        "estimate_missing": reading.estimate.missing or None,
        "sensor": reading.sensor.number,
        "sensor_missing": reading.sensor.missing or None,
        "error_rms": reading.error_rms,
    }
    if reading.channel == TIP_CHANNEL:
        force_n = tip_force_n(reading, options.lever_m)
        found |= {"tip_force_n": force_n, "tip_force_from": reading.source}
    return found | {"half_width95": options.half_widths().get(reading.channel)}
