"""Samples in motion or closing: a model of motion is not valid where friction sticks.

At standstill friction takes any value that satisfies the equation. Such samples are few and their
errors are large: on a simulated rig a twentieth of the samples had more than half of the squared
error, and pulled the torque constant 15 % from its true value. They are left out of fits and of
residuals.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from estimation.recording import FloatArray

SPINDLE_SPEED = "spindle_velocity_rad_s"

CLOSING_RAD_S, TRIM_S = 0.25, 1.0
"""Filtered spindle speed from which a sample counts as closing, and the part omitted at the start
and at the end of each run (O'Neill et al. 2018, section II.C)."""

REST_SHARE, REST_REACH_S = 0.05, 0.02
"""At rest is also: slower than this share of the run's 95th percentile of speed, and what is this
near to rest. The share grows with what the filter smears at a reversal."""


def in_motion(
    speed: FloatArray,
    valid: NDArray[np.bool_],
    sample_rate_hz: float,
    slowest: float,
) -> NDArray[np.bool_]:
    """Return which samples of a run are away from rest, shape (n,).

    The filtered speed is to be trusted at `valid` samples; it is at rest below `slowest`, in its
    unit.
    """
    size = np.abs(speed)
    usual = float(np.percentile(size[valid], 95)) if valid.any() else 0.0
    rest = (size < max(slowest, REST_SHARE * usual)).astype(np.uint8)
    reach = 2 * round(REST_REACH_S * sample_rate_hz) + 1
    return np.asarray(ndimage.maximum_filter1d(rest, reach) == 0)


def longest_rest_s(speed: FloatArray, sample_rate_hz: float, slowest: float) -> float:
    """Return the longest time in a run within which no sample is in motion, s."""
    moving = in_motion(speed, np.ones(len(speed), np.bool_), sample_rate_hz, slowest)
    ends = np.flatnonzero(np.concatenate([[True], moving, [True]]))
    return float(np.diff(ends).max() - 1) / sample_rate_hz


def closing(spindle_speed: FloatArray, sample_rate_hz: float) -> NDArray[np.bool_]:
    """Return which samples of a whole run close the jaw, away from the run's ends, shape (n,)."""
    trim = round(TRIM_S * sample_rate_hz)
    kept = spindle_speed >= CLOSING_RAD_S
    kept[:trim] = False
    kept[max(len(kept) - trim, 0) :] = False
    return kept
