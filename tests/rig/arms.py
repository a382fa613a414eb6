"""Recordings of the PSM for the tests of the arm's studies."""

import numpy as np

from estimation.recording import FloatArray, Recording

REVOLUTE = ("angle_rad", "velocity_rad_s", "torque_n_m")
PRISMATIC = ("position_m", "velocity_m_s", "force_n")


def psm_recording(
    name: str, position: FloatArray, velocity: FloatArray, torque: FloatArray, rate_hz: float
) -> Recording:
    """Return a run of seven joints, the third of them prismatic; the gripper has no torque."""
    effort = np.column_stack([torque[:, :6], np.zeros(len(torque))])
    columns = {}
    for k in range(7):
        values = (position[:, k], velocity[:, k], effort[:, k])
        for unit, column in zip(PRISMATIC if k == 2 else REVOLUTE, values, strict=True):
            columns[f"joint_{k + 1}_{unit}"] = column
    return Recording(name, np.arange(len(position)) / rate_hz, columns)
