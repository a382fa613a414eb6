"""Trajectories of the spindle and of the load motor, sampled at the logger's rate, 1 kHz if unsaid.

Angles are closing-positive. A trajectory starts and ends at rest where its kind allows it.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from estimation.recording import FloatArray

SAMPLE_RATE_HZ = 1000.0


def times(duration_s: float, rate_hz: float = SAMPLE_RATE_HZ) -> FloatArray:
    """Return the sample times of a duration, s."""
    return np.arange(round(duration_s * rate_hz)) / rate_hz


def sine(
    duration_s: float, start_rad: float, amplitude_rad: float, frequency_hz: float
) -> FloatArray:
    """Return grasps as a raised cosine: open at `start_rad`, closed at start + 2 amplitude, rad."""
    phase = 2.0 * np.pi * frequency_hz * times(duration_s)
    return start_rad + amplitude_rad * (1.0 - np.cos(phase))


def speed_staircase(
    start_rad: float, travel_rad: float, speeds_rad_s: Sequence[float], pause_s: float
) -> FloatArray:
    """Return closing and opening at each constant speed in turn, with a rest at each end, rad."""
    pause = np.zeros(round(pause_s * SAMPLE_RATE_HZ))
    parts = [pause]
    for speed in speeds_rad_s:
        ramp = speed * times(travel_rad / speed)
        parts += [ramp, pause + travel_rad, ramp[::-1], pause]
    return start_rad + np.concatenate(parts)


def steps(levels: Sequence[float], hold_s: float, ramp_s: float) -> FloatArray:
    """Return levels held in turn, joined by straight ramps; the first level has no ramp."""
    ramp = np.linspace(0.0, 1.0, max(round(ramp_s * SAMPLE_RATE_HZ), 1), endpoint=False)
    hold = np.ones(round(hold_s * SAMPLE_RATE_HZ))
    parts = [hold * levels[0]]
    for previous, level in itertools.pairwise(levels):
        parts += [previous + (level - previous) * ramp, hold * level]
    return np.concatenate(parts)


def chirp(
    duration_s: float, start_rad: float, amplitude_rad: float, low_hz: float, high_hz: float
) -> FloatArray:
    """Return a raised cosine whose frequency climbs exponentially, open at `start_rad`, rad."""
    t = times(duration_s)
    rate = math.log(high_hz / low_hz) / duration_s
    phase: FloatArray = 2.0 * np.pi * low_hz * np.expm1(rate * t) / rate
    return start_rad + amplitude_rad * (1.0 - np.cos(phase))


def dwells(
    start_rad: float, travel_rad: float, move_s: float, dwells_s: Sequence[float]
) -> FloatArray:
    """Return smooth moves to and fro with a rest of each length before a move, rad."""
    there = minimum_jerk(0.0, travel_rad, move_s)
    parts = []
    for k, dwell_s in enumerate(dwells_s):
        move = there if k % 2 == 0 else there[::-1]
        parts += [np.full(round(dwell_s * SAMPLE_RATE_HZ), move[0]), move]
    return start_rad + np.concatenate(parts)


def minimum_jerk(
    start: float, stop: float, duration_s: float, rate_hz: float = SAMPLE_RATE_HZ
) -> FloatArray:
    """Return the minimum-jerk move between two rests (Flash and Hogan 1985, the quintic)."""
    s = np.linspace(0.0, 1.0, max(round(duration_s * rate_hz), 1))
    return start + (stop - start) * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
