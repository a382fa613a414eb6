"""The sine a run followed: its frequency is read from the trajectory, never from a file name."""

from dataclasses import dataclass

import numpy as np

from estimation.recording import FloatArray

FIT_PERIOD_S = 0.04
"""Samples are thinned to this spacing for the fit: hand and rig trajectories stay below 5 Hz."""
ITERATIONS = 12
CONVERGED_HZ = 1e-7


@dataclass(frozen=True, slots=True)
class Sine:
    """A fitted trajectory centre + amplitude sin(2 pi f t + phase).

    Attributes:
        frequency_hz: Frequency f, Hz.
        centre_rad: Mean of the sine, rad.
        amplitude_rad: Amplitude, rad, not negative.
        phase_rad: Phase at time zero, rad.
        explained_ratio: Share of the variance the sine explains, at most 1.
    """

    frequency_hz: float
    centre_rad: float
    amplitude_rad: float
    phase_rad: float
    explained_ratio: float

    def angle_rad(self, time_s: FloatArray) -> FloatArray:
        """Return the sine at these times, shape of `time_s`."""
        phase = 2 * np.pi * self.frequency_hz * time_s + self.phase_rad
        return np.asarray(self.centre_rad + self.amplitude_rad * np.sin(phase))


def fit_sine(time_s: FloatArray, angle_rad: FloatArray) -> Sine | None:
    """Fit one sine by Gauss-Newton, started at the largest line of the spectrum.

    Args:
        time_s: Evenly sampled time, shape (n,).
        angle_rad: Trajectory, shape (n,).

    Returns:
        The sine, or None where there is nothing to fit: a constant trajectory, fewer than 16
        thinned samples, or less than 0.9 of a period.
    """
    if time_s.size < 2:
        return None
    period_s = (time_s[-1] - time_s[0]) / (time_s.size - 1)
    step = max(1, round(FIT_PERIOD_S / period_s))
    t, y = time_s[::step], angle_rad[::step]
    variance = float(np.var(y))
    if t.size < 16 or variance == 0.0:
        return None
    padded = 8 * t.size
    spectrum = np.abs(np.fft.rfft(y - y.mean(), padded))
    frequency = float(np.argmax(spectrum[1:]) + 1) / (padded * period_s * step)
    # a step beyond half a spectral line would move to another peak
    limit = 0.5 / float(t[-1] - t[0])
    a, b, c = 0.0, 0.0, float(y.mean())
    residual = y
    for _ in range(ITERATIONS):
        phase = 2 * np.pi * frequency * t
        rows = np.stack([np.sin(phase), np.cos(phase), np.ones_like(t)])
        try:
            a, b, c = np.linalg.solve(rows @ rows.T, rows @ y)
            residual = y - (a * rows[0] + b * rows[1] + c)
            slope = 2 * np.pi * t * (a * rows[1] - b * rows[0])
            rows = np.concatenate([rows, slope[None, :]])
            change = float(np.linalg.solve(rows @ rows.T, rows @ residual)[3])
        except np.linalg.LinAlgError:
            return None  # the amplitude vanishes, or the period is far beyond the run
        if not np.isfinite(change):
            return None
        if abs(change) < CONVERGED_HZ:
            break
        frequency = abs(frequency + min(max(change, -limit), limit))
    if frequency * (t[-1] - t[0]) < 0.9:
        return None
    return Sine(
        frequency_hz=frequency,
        centre_rad=float(c),
        amplitude_rad=float(np.hypot(a, b)),
        phase_rad=float(np.arctan2(b, a)),
        explained_ratio=1.0 - float(np.var(residual)) / variance,
    )
