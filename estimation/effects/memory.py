"""States that several effects share: a run's age, a first-order lag, a contact that may stick."""

import numba
import numpy as np

from estimation.effects.effect import Inputs, Parameter
from estimation.recording import FloatArray

BEGINNING = (0.0, 0.0)
"""State of `age` before the first sample: started (0 or 1), the time of the first sample."""


@numba.njit(cache=True)
def age(time: float, state: FloatArray) -> float:
    """Return the time since the first sample."""
    if not state[0]:
        state[0], state[1] = 1.0, time
    return float(time - state[1])


def not_settled(inputs: Inputs, time_s: float) -> FloatArray:
    """Return the share of a change over a campaign that is yet to come, 1 at its start."""
    share: FloatArray = np.exp(-np.maximum(inputs["campaign_clock"], 0.0) / time_s)
    return share


@numba.njit(cache=True)
def behind(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), the last time, the last input, output minus input.

    Roles are the clock and the input, the shape is the time constant, the column is the lag's
    output minus its input. Exact for an input that is linear between two samples, so the sample
    rate does not matter; steady on the first sample.
    """
    constant = shape[0]
    for i in range(len(now)):
        time, value = now[i, 0], now[i, 1]
        past = time - state[1] if state[0] else 0.0
        if past > 0.0:
            steady = constant * (value - state[2]) / past  # steady lag behind a ramp
            state[3] = (state[3] + steady) * np.exp(-past / constant) - steady
        state[0], state[1], state[2] = 1.0, time, value
        rows[i, 0] = state[3]


AT_REST = (0.0, 0.0, 0.0, 0.0)
"""State of `behind` before the first sample."""

REST = (0.0, 0.0, 0.0, 0.0)
"""State of `advance`: started (0 or 1), last travel, last drive, active fraction of friction."""

SHAPE = (
    Parameter("reach", "travel", "travel to reach 63 % of sliding friction", 3e-3, 3e0),
    Parameter("limit", "drive", "drive held by static friction without load", 5e-3, 3e-1),
    Parameter("share", "1", "increase of the limit per unit of drive", 3e-2, 3e0),
)


@numba.njit(cache=True)
def advance(travel: float, drive: float, shape: FloatArray, state: FloatArray) -> float:
    """Return the active fraction of friction, -1 to 1, after one more sample.

    At standstill friction equals the drive, up to its limit. That value does not follow from the
    speed, and an encoder is too coarse for the deflection; but it is the sum of the drive's changes
    since the contact stuck. So the state follows the drive while it sticks and the travel while it
    slides.

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
