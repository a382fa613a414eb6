"""The active fraction of friction of a contact that may stick: a state of travel and drive.

At standstill friction equals the drive, up to its limit. That value does not follow from the speed,
and an encoder is too coarse for the deflection; but it is the sum of the drive's changes since the
contact stuck. So the state follows the drive while it sticks and the travel while it slides.
"""

import numba
import numpy as np

from estimation.effects.effect import Parameter
from estimation.recording import FloatArray

REST = (0.0, 0.0, 0.0, 0.0)
"""Started (0 or 1), last travel, last drive, and the active fraction of friction."""

SHAPE = (
    Parameter("reach", "travel", "travel to reach 63 % of sliding friction", 3e-3, 3e0),
    Parameter("limit", "drive", "drive held by static friction without load", 5e-3, 3e-1),
    Parameter("share", "1", "increase of the limit per unit of drive", 3e-2, 3e0),
)


@numba.njit(cache=True)
def advance(travel: float, drive: float, shape: FloatArray, state: FloatArray) -> float:
    """Return the active fraction of friction, -1 to 1, after one more sample.

    Source: Karnopp 1985, "Computer simulation of stick-slip friction", for sticking; Dahl 1968, "A
    solid friction model", for the transition from sticking to sliding.
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
