"""The audit before a search: clocks, delays between channels, conditions that never vary.

It decides nothing. Its sentences are the limits of a search on these runs.
"""

from collections.abc import Sequence

import numpy as np
from scipy import signal

from estimation.diagnosis.clock import skips
from estimation.recording import Recording, shared_columns

PAIRS = (
    ("motor_angle_rad", "spindle_angle_rad"),
    ("spindle_angle_rad", "jaw_angle_rad"),
    ("proximal_torque_n_m", "distal_torque_n_m"),
)
"""Channels that move together, the earlier one first."""

BAND_HZ, SEGMENT_S = (0.5, 8.0), 4.0
COHERENT = 0.9
"""Frequencies determine a delay where at least this share of the power is common."""

STEADY = 1e-3
"""A condition that varies by less than this share of its size is held."""


def audit(recordings: Sequence[Recording]) -> list[str]:
    """Return the limits of the recordings, one sentence each."""
    return [*skips(recordings), *_delays(recordings), *_excitation(recordings)]


def delay_s(recording: Recording, first: str, second: str) -> float | None:
    """Return the delay of the second channel after the first; None where it is not determined.

    The slope of the cross-spectrum's phase over frequency, weighted by how sure each phase is
    (Carter, "Coherence and time delay estimation", Proceedings of the IEEE 75, 1987).

    Args:
        recording: One run; its samples are taken as evenly spaced.
        first: Channel that should come first.
        second: Channel that follows it.
    """
    rate_hz = recording.sample_rate_hz
    length = int(SEGMENT_S * rate_hz)
    if len(recording) < 2 * length:
        return None
    one, two = (np.diff(recording[name]) for name in (first, second))
    f, cross = signal.csd(one, two, rate_hz, nperseg=length)
    _, common = signal.coherence(one, two, rate_hz, nperseg=length)
    told = (f >= BAND_HZ[0]) & (f <= BAND_HZ[1]) & (common >= COHERENT) & (common < 1.0)
    if np.count_nonzero(told) < 3:
        return None
    w, phase = 2 * np.pi * f[told], np.angle(cross[told])
    sure = common[told] / (1.0 - common[told])
    return float(-np.sum(sure * w * phase) / np.sum(sure * w * w))


def _delays(recordings: Sequence[Recording]) -> list[str]:
    said = []
    for first, second in PAIRS:
        held = [r for r in recordings if first in r and second in r]
        found = [d for r in held if (d := delay_s(r, first, second)) is not None]
        if len(found) < 3:
            continue
        middle = float(np.median(found))
        spread = float(np.median(np.abs(np.array(found) - middle)))
        said.append(
            f"Timing: {second} comes {1e3 * middle:+.1f} ms after {first} (median of"
            f" {len(found)} runs, half within {1e3 * spread:.1f} ms); this includes the compliance"
            " between the two sensors."
        )
    return said


def _excitation(recordings: Sequence[Recording]) -> list[str]:
    said = []
    shared = shared_columns(recordings)
    for name in shared:
        spans = [float(np.ptp(r[name])) for r in recordings]
        if not np.isfinite(spans).all():
            continue
        size = max(float(np.max(np.abs(r[name]))) for r in recordings)
        if max(spans) <= STEADY * size:
            levels = {round(float(np.mean(r[name])) / max(size, 1e-300), 3) for r in recordings}
            held = "never varies" if len(levels) == 1 else "is held within each run"
            said.append(f"{name} {held}: an effect that depends on it is not decided within a run.")
    return said
