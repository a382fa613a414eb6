"""The share of friction that acts when a contact may stick: a state of travel and drive.

At rest friction is whatever balances the drive, up to its limit. No speed tells that value, and an
encoder is too coarse for the deflection that would; but the drive's changes since the contact stuck
add up to it. So the state follows the drive while it sticks and the travel while it slides.
"""

import numba
import numpy as np

from estimation.effects.effect import Parameter
from estimation.recording import FloatArray

REST = (0.0, 0.0, 0.0, 0.0)
"""Whether a sample has come, its travel, its drive, and the share of friction that acts."""

SHAPE = (
    Parameter("reach", "travel", "way after which 63 % of sliding friction is there", 3e-3, 3e0),
    Parameter("limit", "drive", "drive that sticking friction holds without load", 5e-3, 3e-1),
    Parameter("share", "1", "more of it for each unit of drive", 3e-2, 3e0),
)


@numba.njit(cache=True)
def advance(travel: float, drive: float, shape: FloatArray, state: FloatArray) -> float:
    """Return the share of friction that acts, -1 to 1, after one more sample.

    Source: Karnopp 1985, "Computer simulation of stick-slip friction", for what acts while it
    sticks; Dahl 1968, "A solid friction model", for the way from sticking to sliding.
    """
    if state[0] == 0.0:
        state[0], state[1], state[2] = 1.0, travel, drive
    state[3] += (drive - state[2]) / (shape[1] + shape[2] * abs(drive))
    moved = (travel - state[1]) / shape[0]
    way = 1.0 if moved > 0.0 else -1.0
    state[3] = way + (state[3] - way) * np.exp(-abs(moved))
    state[3] = min(max(state[3], -1.0), 1.0)
    state[1], state[2] = travel, drive
    return float(state[3])
