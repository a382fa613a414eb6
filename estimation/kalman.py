"""Speed and acceleration of an encoder's angle, live: a Kalman filter in its steady state.

The motion model is constant acceleration with a random disturbance in every sample; the encoder's
quantisation is the noise. filterpy designs the filter; its constant gain runs as compiled code.

Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, "Estimation with Applications to Tracking and
Navigation" (2001), section 6.3.2, discrete white noise acceleration, third-order model.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from estimation.recording import FloatArray, read_only

DISTURBANCE_RAD_S2 = 4.0
"""Change of the motor's acceleration from sample to sample at 1 kHz. Of 0.3 to 30 this one gave the
smallest torque errors on the public data set, fitted and used live."""

ANGLE_NOISE_RAD = 2 * np.pi / 4096 / np.sqrt(12)
"""Quantisation of the reference rig's motor encoder, standard deviation."""

UPDATES = 5000
"""Updates after which the gain no longer changes."""


@dataclass(frozen=True, eq=False)
class Tracker:
    """The filter's constant gain."""

    period_s: float
    gain: FloatArray  # of angle, speed and acceleration, for an innovation of 1 rad, (3,)

    @property
    def acceleration_lag_s(self) -> float:
        """Time by which the acceleration trails one that rises evenly, s."""
        return float(self.gain[1] / self.gain[2] - self.period_s / 2)

    def start(self, angle_rad: float) -> FloatArray:
        """Return the state of a motor at rest, for `track` to continue from, shape (3,)."""
        return np.array([angle_rad, 0.0, 0.0])

    def track(self, angles_rad: ArrayLike, state: FloatArray) -> FloatArray:
        """Return angle, speed and acceleration for the next angles, shape (n, 3).

        The angles, shape (n,), are finite and one sample period apart; `state` is updated in place.
        """
        return _track(np.asarray(angles_rad, np.float64), self.gain, self.period_s, state)


@lru_cache
def tracker(sample_rate_hz: float) -> Tracker:
    """Return the filter for a sample rate; the disturbance is scaled to its period."""
    gain = steady_filter(sample_rate_hz).K[:, 0]
    return Tracker(1.0 / sample_rate_hz, read_only(gain))


def steady_filter(sample_rate_hz: float):  # type: ignore[no-untyped-def]
    """Return filterpy's Kalman filter after so many updates that its gain is constant."""
    from filterpy.common import Q_discrete_white_noise
    from filterpy.kalman import KalmanFilter

    period_s = 1.0 / sample_rate_hz
    disturbance = DISTURBANCE_RAD_S2 * np.sqrt(period_s / 1e-3)
    found = KalmanFilter(dim_x=3, dim_z=1)
    found.F = np.array([[1, period_s, period_s**2 / 2], [0, 1, period_s], [0, 0, 1]])
    found.H = np.array([[1.0, 0.0, 0.0]])
    found.R *= ANGLE_NOISE_RAD**2
    found.Q = Q_discrete_white_noise(dim=3, dt=period_s, var=disturbance**2)
    found.P = np.diag([1e-6, 1.0, 1e6])
    for _ in range(UPDATES):
        found.predict()
        found.update(np.zeros((1, 1)))
    return found


@njit(cache=True)
def _track(angles: FloatArray, gain: FloatArray, period: float, state: FloatArray) -> FloatArray:
    found = np.empty((len(angles), 3))
    angle, speed, acceleration = state[0], state[1], state[2]
    for n in range(len(angles)):
        angle += period * (speed + 0.5 * period * acceleration)
        speed += period * acceleration
        innovation = angles[n] - angle
        angle += gain[0] * innovation
        speed += gain[1] * innovation
        acceleration += gain[2] * innovation
        found[n, 0], found[n, 1], found[n, 2] = angle, speed, acceleration
    state[0], state[1], state[2] = angle, speed, acceleration
    return found
