"""Find the stretches of a run in which the rig did not work as intended; flag them, drop nothing.

Limits were set on the 270 measured runs of 15 folders. Valid samples stay below 0.34 A, the spindle
within 0.14 rad of its target, and the motor (seen through the gear) within 1.2 rad/s of the
trajectory's speed. Runaways reach 0.56 A, 0.86 rad and 3.2 to 19 rad/s. The two older folders begin
each run with a jerk of 0.5 to 1.7 rad/s within 50 ms: there the speed limit cuts a continuum, and
only the largest jerks are flagged.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from estimation.recording import Flag, FloatArray, Recording, Stretch

SATURATED = {
    "motor_current_a": (0.5, "the current controller is at its limit: {:.3f} A"),
    "motor_command_ratio": (1.0, "the command is beyond full scale: {:.3f}"),
}
"""Channel to its limit and the reason that is stated beyond it."""
TRACKING_LIMIT_RAD = 0.25
SPEED_LIMIT_RAD_S = 1.5
SPEED_SPAN_SAMPLES = 10
"""Half width of the central difference the speeds are taken with."""
MERGE_S = 0.25
"""Bad samples closer than this are one event."""
MARGIN_S = 0.02
"""Added to both ends of an event: it begins before it is large enough to be seen."""
START_S = 0.3
"""An event that begins within this time of the first sample is a start transient."""


def bad_stretches(
    recording: Recording, intended_angle_rad: FloatArray | None, step_s: float, gear_ratio: float
) -> list[Stretch]:
    """Return the stretches in which something is missing, saturated or runs away, by their start.

    Runaways are looked for where the intended angle of the spindle, shape (n,), is known. The gear
    ratio is motor turns a spindle turn.
    """
    found = [*_missing(recording.time_s, step_s), *_saturated(recording)]
    if intended_angle_rad is not None:
        found += _runaways(recording, intended_angle_rad, gear_ratio)
    return sorted(found, key=lambda stretch: stretch.start_s)


def _saturated(recording: Recording) -> Iterator[Stretch]:
    time_s = recording.time_s
    for channel, (limit, reason) in SATURATED.items():
        size = np.abs(recording[channel])
        for first, last in _events(time_s, size > limit):
            why = reason.format(float(size[first : last + 1].max()))
            start_s, stop_s = float(time_s[first]), float(time_s[last])
            yield Stretch(start_s, stop_s, Flag.SATURATED, why, channel)


def _missing(time_s: FloatArray, step_s: float) -> Iterator[Stretch]:
    steps = np.diff(time_s)
    for place in np.flatnonzero(steps > 1.5 * step_s):
        at_s, lost = float(time_s[place + 1]), round(steps[place] / step_s) - 1
        yield Stretch(at_s, at_s, Flag.MISSING, f"{lost} samples are missing before this one")


def _runaways(
    recording: Recording, intended_angle_rad: FloatArray, gear_ratio: float
) -> Iterator[Stretch]:
    """Flag events in which the rig left its trajectory.

    Either the spindle is far from the intended angle, or the motor runs at another speed than the
    trajectory asks for: a gear or cable that lets go shows in the motor first.
    """
    time_s = recording.time_s
    distance = np.abs(recording["spindle_angle_rad"] - intended_angle_rad)
    excess = np.abs(_slope(time_s, recording["motor_angle_rad"] / gear_ratio - intended_angle_rad))
    bad = (distance > TRACKING_LIMIT_RAD) | (excess > SPEED_LIMIT_RAD_S)
    for first, last in _events(time_s, bad):
        start_s, stop_s = float(time_s[first]) - MARGIN_S, float(time_s[last]) + MARGIN_S
        at_start = start_s < time_s[0] + START_S
        inside = slice(first, last + 1)
        yield Stretch(
            float(time_s[0]) if at_start else start_s,
            min(stop_s, float(time_s[-1])),
            Flag.SUSPECT,
            f"{'start transient' if at_start else 'runaway'}: the motor departs from the "
            f"trajectory by up to {excess[inside].max():.1f} rad/s (behind the gear), the "
            f"spindle by {distance[inside].max():.2f} rad",
        )


def _slope(time_s: FloatArray, values: FloatArray) -> FloatArray:
    """Central difference over 2 x SPEED_SPAN_SAMPLES; zero where the span does not fit."""
    span = SPEED_SPAN_SAMPLES
    slope = np.zeros_like(values)
    if values.size > 2 * span:
        rise = values[2 * span :] - values[: -2 * span]
        slope[span:-span] = rise / (time_s[2 * span :] - time_s[: -2 * span])
    return slope


def _events(time_s: FloatArray, bad: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Group bad samples into events (first index, last index)."""
    index = np.flatnonzero(bad)
    if index.size:
        for event in np.split(index, np.flatnonzero(np.diff(time_s[index]) > MERGE_S) + 1):
            yield int(event[0]), int(event[-1])
