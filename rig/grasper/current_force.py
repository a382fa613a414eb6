"""Force at the grasper's tip from motor current (Zhao and Nelson 2016), and without its lag."""

from dataclasses import dataclass

import numpy as np
from scipy import signal

from estimation.filters import CausalFilter, LowPass
from estimation.recording import FloatArray

FILTER = LowPass(cutoff_hz=3.0, order=2)
"""3 Hz is the paper's; it does not state the order."""

SLOW = LowPass(cutoff_hz=1.0, order=1)
FORGET_S = 0.5
LEAST_RAD2 = 1e-6
"""Below this variance of the angle nothing moves, and there is nothing to bring up to date."""


@dataclass(frozen=True, slots=True)
class CurrentForce:
    """The paper's equations 12 to 14 without inertia, as in the paper.

    F = c N K i / l, i low-passed at 3 Hz. The coefficient c is one over the slope of estimate over
    force in long steady grasps (Table 2).

    Attributes:
        arm_m: From the joint to where the force acts; the paper does not state it.
        coefficient: c.
        gearhead_ratio: N; 66.
        torque_constant_n_m_a: K, of the motor's data sheet.
    """

    arm_m: float
    coefficient: float = 1.0
    gearhead_ratio: float = 66.0
    torque_constant_n_m_a: float = 14.6e-3

    def force_n(self, motor_current_a: FloatArray, sample_rate_hz: float) -> FloatArray:
        """Return the force of a motor's current, or of the mean of both jaws', causal, shape (n,).

        The paper samples at 2000 Hz.

        Raises:
            FilterError: The rate is too low for the filter.
        """
        low = CausalFilter(sample_rate_hz, FILTER).step(motor_current_a[:, None])[:, 0]
        gain = self.gearhead_ratio * self.torque_constant_n_m_a / self.arm_m
        return self.coefficient * gain * low


def angle_led(
    force_n: FloatArray, angle_rad: FloatArray, sample_rate_hz: float, low_pass: LowPass
) -> FloatArray:
    """Return the force without the lag of its low-pass filter, causal, shape (n,).

    While something is held the force follows the angle. Its stiffness is the slope of the force
    over the equally late angle in the last half second; what the filter has not yet let through of
    the angle, shape (n,), times that stiffness, is what it has not yet let through of the force.

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
