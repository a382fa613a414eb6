"""Find the stretches of a run in which the rig did not work as intended; flag them, drop nothing.

Limits were set on the 270 measured runs of 15 folders. Valid samples stay below 0.34 A, the spindle
within 0.14 rad of its target, and the motor (seen through the gear) within 1.2 rad/s of the
trajectory's speed. Runaways reach 0.56 A, 0.86 rad and 3.2 to 19 rad/s. The two older folders begin
each run with a jerk of 0.5 to 1.7 rad/s within 50 ms: there the speed limit cuts a continuum, and
only the largest jerks are flagged.
"""

import numpy as np
from numpy.typing import NDArray

from estimation.recording import Flag, FloatArray, Stretch

CURRENT_LIMIT_A = 0.5
COMMAND_LIMIT_RATIO = 1.0
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


def saturated(time_s: FloatArray, current_a: FloatArray, command: FloatArray) -> list[Stretch]:
    """Flag clipped current and a command beyond full scale.

    Args:
        time_s: Time, shape (n,).
        current_a: Measured motor current, shape (n,).
        command: Command to the current controller, 1 is full scale, shape (n,).
    """
    found = []
    for channel, values, limit, reason in (
        (
            "motor_current_a",
            current_a,
            CURRENT_LIMIT_A,
            "the current controller is at its limit: {:.3f} A",
        ),
        (
            "motor_command_ratio",
            command,
            COMMAND_LIMIT_RATIO,
            "the command is beyond full scale: {:.3f}",
        ),
    ):
        for first, last in _events(time_s, np.abs(values) > limit, MERGE_S):
            peak = float(np.abs(values[first : last + 1]).max())
            found.append(
                Stretch(
                    float(time_s[first]),
                    float(time_s[last]),
                    Flag.SATURATED,
                    reason.format(peak),
                    channel,
                )
            )
    return found


def missing(time_s: FloatArray, step_s: float) -> list[Stretch]:
    """Flag the sample after each gap in time.

    Args:
        time_s: Time, shape (n,).
        step_s: Sample period, s.
    """
    steps = np.diff(time_s)
    return [
        Stretch(
            float(time_s[i + 1]),
            float(time_s[i + 1]),
            Flag.MISSING,
            f"{round(steps[i] / step_s) - 1} samples are missing before this one",
        )
        for i in np.flatnonzero(steps > 1.5 * step_s)
    ]


def runaways(
    time_s: FloatArray,
    spindle_angle_rad: FloatArray,
    motor_angle_rad: FloatArray,
    intended_angle_rad: FloatArray,
    gear_ratio: float,
) -> list[Stretch]:
    """Flag events in which the rig left its trajectory.

    Either the spindle is far from the intended angle, or the motor runs at another speed than the
    trajectory asks for: a gear or cable that lets go shows in the motor first.

    Args:
        time_s: Time, shape (n,).
        spindle_angle_rad: Spindle, shape (n,).
        motor_angle_rad: Motor shaft before the gear, shape (n,).
        intended_angle_rad: Target of the spindle, shape (n,).
        gear_ratio: Motor turns a spindle turn.
    """
    distance = np.abs(spindle_angle_rad - intended_angle_rad)
    lag = motor_angle_rad / gear_ratio - intended_angle_rad
    excess = np.abs(_slope(time_s, lag))
    found = []
    bad = (distance > TRACKING_LIMIT_RAD) | (excess > SPEED_LIMIT_RAD_S)
    for first, last in _events(time_s, bad, MERGE_S):
        start_s, stop_s = float(time_s[first]) - MARGIN_S, float(time_s[last]) + MARGIN_S
        at_start = start_s < time_s[0] + START_S
        inside = slice(first, last + 1)
        found.append(
            Stretch(
                float(time_s[0]) if at_start else start_s,
                min(stop_s, float(time_s[-1])),
                Flag.SUSPECT,
                f"{'start transient' if at_start else 'runaway'}: the motor departs from the "
                f"trajectory by up to {excess[inside].max():.1f} rad/s (behind the gear), the "
                f"spindle by {distance[inside].max():.2f} rad",
            )
        )
    return found


def _slope(time_s: FloatArray, values: FloatArray) -> FloatArray:
    """Central difference over 2 x SPEED_SPAN_SAMPLES; zero where the span does not fit."""
    span = SPEED_SPAN_SAMPLES
    slope = np.zeros_like(values)
    if values.size > 2 * span:
        rise = values[2 * span :] - values[: -2 * span]
        slope[span:-span] = rise / (time_s[2 * span :] - time_s[: -2 * span])
    return slope


def _events(time_s: FloatArray, bad: NDArray[np.bool_], merge_s: float) -> list[tuple[int, int]]:
    """Group bad samples into events (first index, last index)."""
    index = np.flatnonzero(bad)
    if index.size == 0:
        return []
    breaks = np.flatnonzero(np.diff(time_s[index]) > merge_s)
    firsts = index[np.concatenate([[0], breaks + 1])]
    lasts = index[np.concatenate([breaks, [index.size - 1]])]
    return [(int(a), int(b)) for a, b in zip(firsts, lasts, strict=True)]
