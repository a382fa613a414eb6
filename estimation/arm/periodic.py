"""Derivatives of periodic motion in the frequency domain, as E. del Sol et al. 2014 take them.

The paper multiplies bin k of a transform over P samples by a frequency; its printed factor lacks
the imaginary unit. The derivative of exp(j 2 pi k f_s t / P) brings down
j 2 pi k f_s / P, and k counts negative frequencies in the upper half.
"""

import numpy as np

from estimation.arm.kinematics import ArmError
from estimation.arm.motion import Motion
from estimation.recording import FloatArray


def periodic_motion(position: FloatArray, period_s: float, highest_hz: float) -> Motion:
    """Return position, velocity and acceleration of a whole number of periods.

    Args:
        position: Shape (n, joints): whole periods, the last sample one before the first again.
        period_s: Sample period, s.
        highest_hz: Frequencies above it are left out, on all three alike, Hz.

    Raises:
        ArmError: Too few samples, or the frequency is not within half the sample rate.
    """
    if len(position) < 4 or not 0 < highest_hz <= 0.5 / period_s:
        raise ArmError(
            f"{len(position)} samples cannot be differentiated up to {highest_hz:g} Hz.",
            f"At {1 / period_s:g} samples a second, frequencies reach {0.5 / period_s:g} Hz.",
        )
    frequency_hz = np.fft.rfftfreq(len(position), period_s)
    pulse = 2j * np.pi * frequency_hz[:, None]
    spectrum = np.fft.rfft(position, axis=0)
    spectrum[frequency_hz > highest_hz] = 0
    smooth, velocity, acceleration = (
        np.fft.irfft(spectrum * pulse**k, len(position), axis=0) for k in range(3)
    )
    return Motion(smooth, velocity, acceleration, period_s)
