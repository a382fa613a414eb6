"""Force at the grasper's tip from motor current, by the method of Zhao and Nelson 2016."""

from dataclasses import dataclass

from estimation.filters import CausalFilter, LowPass
from estimation.recording import FloatArray

FILTER = LowPass(cutoff_hz=3.0, order=2)
"""3 Hz is the paper's; it does not state the order."""


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
        """Return the force, causal as live, shape (n,).

        Args:
            motor_current_a: Current of the motor, or the mean of both jaws' motors, shape (n,).
            sample_rate_hz: 2000 in the paper.

        Raises:
            FilterError: The rate is too low for the filter.
        """
        low = CausalFilter(sample_rate_hz, FILTER).step(motor_current_a[:, None])[:, 0]
        gain = self.gearhead_ratio * self.torque_constant_n_m_a / self.arm_m
        return self.coefficient * gain * low
