"""A low-passed force brought up to date by the angle, which has no noise worth filtering."""

import numpy as np
from scipy import signal

from estimation.filters import CausalFilter, LowPass
from estimation.recording import FloatArray

SLOW = LowPass(cutoff_hz=1.0, order=1)
FORGET_S = 0.5
LEAST_RAD2 = 1e-6
"""Below this variance of the angle nothing moves, and there is nothing to bring up to date."""


def angle_led(
    force_n: FloatArray, angle_rad: FloatArray, sample_rate_hz: float, low_pass: LowPass
) -> FloatArray:
    """Return the force without the lag of its filter, causal, shape (n,).

    While something is held the force follows the angle. Its stiffness is the slope of the force
    over the equally late angle in the last half second; what the filter has not yet let through of
    the angle, times that stiffness, is what it has not yet let through of the force.

    Args:
        force_n: Estimate, low-passed, shape (n,).
        angle_rad: Joint angle as it was measured, shape (n,).
        sample_rate_hz: Rate of both.
        low_pass: The filter that the force went through.

    Raises:
        FilterError: The rate is too low for the filter.
    """
    late = CausalFilter(sample_rate_hz, low_pass).step(angle_rad[:, None])[:, 0]
    both = np.column_stack([force_n, late])
    force, angle = (both - CausalFilter(sample_rate_hz, SLOW).step(both)).T
    kept = np.exp(-1.0 / (FORGET_S * sample_rate_hz))
    together, alone = (
        signal.lfilter([1.0 - kept], [1.0, -kept], product)
        for product in (force * angle, angle * angle)
    )
    stiffness = np.maximum(together, 0.0) / np.maximum(alone, LEAST_RAD2)
    return np.asarray(force_n + stiffness * (angle_rad - late))
