"""From strain gauges to a wrench, and a wrench about another point."""

import numpy as np
from numpy.typing import NDArray


def wrench_of(
    gauges: NDArray[np.int16],
    bias: NDArray[np.float64],
    matrix: NDArray[np.float64],
    unit_per_count: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return force and torque, shape (6,), N and N m.

    Args:
        gauges: Readings, counts, shape (6,).
        bias: Readings without load, counts, shape (6,).
        matrix: Calibration matrix, shape (6, 6), a row an axis.
        unit_per_count: N a count three times, then N m a count three times, shape (6,).
    """
    wrench: NDArray[np.float64] = (matrix @ (gauges - bias)) * unit_per_count
    return wrench


def moved_wrench(wrench: NDArray[np.float64], point_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a wrench about another point, axes unchanged, shape (..., 6).

    The force stays; the torque becomes T' = T + r x F, with r from the new point to the old one,
    here `-point_m`.

    Args:
        wrench: Force and torque about the sensor's origin, N and N m, shape (..., 6).
        point_m: The new point in the sensor's axes, m, shape (3,).
    """
    force, torque = wrench[..., :3], wrench[..., 3:]
    return np.concatenate((force, torque + np.cross(-point_m, force)), axis=-1)
