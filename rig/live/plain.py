"""The stream as lines: one for people twice a second, one JSON object for machines at 10 Hz."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from rig.live import text as words
from rig.live.state import Reading, Snapshot

NOT_KNOWN: Mapping[str, float] = MappingProxyType({})


def plain_line(
    snapshot: Snapshot, lever_m: float, half_widths: Mapping[str, float] = NOT_KNOWN
) -> str:
    """Return one line on a snapshot, for logs and for terminals that cannot draw."""
    time = "no samples yet" if snapshot.time_s is None else f"{snapshot.time_s:8.1f} s"
    parts = [time]
    for reading in snapshot.readings:
        source, value = words.main_value(reading)
        shown = words.with_unit(value, reading.unit)
        if source == "estimate":
            shown += words.interval(half_widths.get(reading.channel), reading.unit)
        parts.append(f"{words.name_of(reading.channel)}, {source} {shown}")
        force_n = words.tip_force_n(reading, value, lever_m)
        if force_n is not None:
            parts.append(f"{force_n:.2f} N at {lever_m * 1e3:g} mm")
        if source == "estimate":
            parts.append(f"sensor {words.with_unit(reading.sensor, reading.unit)}")
            parts.append(words.error_rms(reading))
    parts += [words.rate(snapshot), words.lost(snapshot.lost, snapshot.samples)]
    parts += [f"{device.name} {device.state}" for device in snapshot.devices]
    parts += [
        f"{limit.name} {words.limit_words(limit)}"
        for limit in snapshot.limits
        if words.limit_style(words.limit_share(limit)) != "good"
    ]
    parts += [f"flagged: {words.flagged(snapshot.flagged)}"] if snapshot.flagged else []
    return " | ".join(parts)


def json_frame(
    snapshot: Snapshot, lever_m: float, half_widths: Mapping[str, float] = NOT_KNOWN
) -> dict[str, Any]:
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
        "flagged": dict(snapshot.flagged),
        "lever_m": lever_m,
        "estimate_half_width95": half_widths.get(snapshot.readings[0].channel),
        "channels": {
            r.channel: _json_reading(r, lever_m) | {"half_width95": half_widths.get(r.channel)}
            for r in snapshot.readings
        },
        "devices": snapshot.devices,
        "limits": snapshot.limits,
    }


def _json_reading(reading: Reading, lever_m: float) -> dict[str, Any]:
    source, value = words.main_value(reading)
    found: dict[str, Any] = {
        "unit": reading.unit,
        "estimate": reading.estimate.number,
        "estimate_missing": reading.estimate.missing or None,
        "sensor": reading.sensor.number,
        "sensor_missing": reading.sensor.missing or None,
        "error_rms": reading.error_rms,
    }
    if reading.channel == words.TIP_CHANNEL:
        force_n = words.tip_force_n(reading, value, lever_m)
        found |= {"tip_force_n": force_n, "tip_force_from": source}
    return found
