"""The sine a run followed: its frequency is read from the trajectory, never from a file name."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from estimation.recording import FloatArray

FIT_PERIOD_S = 0.04
"""Samples are thinned to this spacing for the fit: hand and rig trajectories stay below 5 Hz."""
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
    """Fit one sine by least squares, within a line of the largest peak of the spectrum.

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
    peak_hz = float(np.argmax(spectrum[1:]) + 1) / (padded * period_s * step)
    line_hz = 1.0 / float(t[-1] - t[0])

    def gains_and_residual(frequency_hz: float) -> tuple[FloatArray, FloatArray]:
        phase = 2 * np.pi * frequency_hz * t
        rows = np.stack([np.sin(phase), np.cos(phase), np.ones_like(t)])
        gains = np.linalg.lstsq(rows @ rows.T, rows @ y)[0]
        return gains, y - gains @ rows

    best = minimize_scalar(
        lambda frequency_hz: float(np.sum(gains_and_residual(frequency_hz)[1] ** 2)),
        bounds=(max(peak_hz - line_hz, 0.5 * line_hz), peak_hz + line_hz),
        method="bounded",
        options={"xatol": CONVERGED_HZ},
    )
    if best.x < 0.9 * line_hz:
        return None
    (a, b, c), residual = gains_and_residual(float(best.x))
    return Sine(
        frequency_hz=float(best.x),
        centre_rad=float(c),
        amplitude_rad=float(np.hypot(a, b)),
        phase_rad=float(np.arctan2(b, a)),
        explained_ratio=1.0 - float(np.var(residual)) / variance,
    )
