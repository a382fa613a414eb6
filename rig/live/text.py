"""The words of the display: numbers with their unit, or why a number is missing.

SI ends here: torque is shown in mN m and angles in degrees, to people only.
"""

import math
from collections.abc import Mapping

from estimation.channels import describe
from rig.live.block import LimitStatus
from rig.live.state import Reading, Snapshot, Summary, Value

SHOWN = {"N m": (1e3, "mN m", 1), "rad": (180 / math.pi, "deg", 2), "N": (1.0, "N", 2)}
"""SI unit to its factor, name and decimals on the display."""

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


def in_shown_unit(unit: str) -> tuple[float, str, int]:
    """Return the factor from SI, the unit's name and the decimals of the display."""
    return SHOWN.get(unit, (1.0, unit, 3))


def name_of(channel: str) -> str:
    """Return the common name of a channel."""
    return NAMES.get(channel) or describe(channel).description.capitalize()


def digits(value: Value, unit: str) -> str | None:
    """Return the number alone in the display's unit, or None when there is none."""
    if value.number is None:
        return None
    factor, _, decimals = in_shown_unit(unit)
    # adding zero turns -0.0 into 0.0
    return f"{round(value.number * factor, decimals) + 0.0:.{decimals}f}"


def with_unit(value: Value, unit: str) -> str:
    """Return the number with its unit, or `no value` and the reason."""
    number = digits(value, unit)
    if number is None:
        return f"no value ({value.missing})"
    return f"{number} {in_shown_unit(unit)[1]}"


def main_value(reading: Reading) -> tuple[str, Value]:
    """Return the main value of the display: the estimate, or the sensor without an estimate."""
    if reading.has_estimator:
        return "estimate", reading.estimate
    return "sensor", reading.sensor


def tip_force_n(reading: Reading, value: Value, lever_m: float) -> float | None:
    """Return the force at the jaw tip, N, or None without a value or a lever.

    Grip force is jaw torque over the lever arm (O'Neill et al. 2018 measured 12 mm).
    """
    if reading.channel != TIP_CHANNEL or value.number is None:
        return None
    return value.number / lever_m


def interval(half_width: float | None, unit: str) -> str:
    """Return the 95 % interval of an estimate in words; empty where it is not known."""
    if half_width is None:
        return ""
    return f" ±{with_unit(Value(half_width), unit)}"


def error_rms(reading: Reading) -> str:
    """Return the error of the estimate against the sensor in words."""
    if reading.error_rms is None:
        return "error unknown"
    return f"error rms {with_unit(Value(reading.error_rms), reading.unit)} in 5 s"


def rate(snapshot: Snapshot) -> str:
    """Return the sample rate in words."""
    if snapshot.sample_rate_hz is None:
        return "rate unknown"
    return f"{snapshot.sample_rate_hz:.0f} Hz"


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


def limit_style(share: float | None) -> str:
    """Return the style of a limit by the share of it that is used."""
    return "bad" if share is None or share >= 1 else "warning" if share >= 0.8 else "good"


def limit_words(limit: LimitStatus) -> str:
    """Return a limit in numbers, with a word when it is near or reached."""
    share = limit_share(limit)
    most = with_unit(Value(limit.limit), limit.unit)
    if share is None:
        return f"no value, limit {most}"
    word = " AT LIMIT" if share >= 1 else " near" if share >= 0.8 else ""
    return f"{digits(Value(limit.value), limit.unit)} of {most}, {100 * share:.0f} %{word}"


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
