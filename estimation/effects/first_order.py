"""How far a first-order lag is behind its input: shared by the effects that follow slowly."""

import numba
import numpy as np

from estimation.recording import FloatArray


@numba.njit(cache=True)
def behind(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Walk; state: whether a sample has come, the last time, the last input, output less input.

    Roles are the clock and the input, the shape is the time constant, the column is the lag's
    output less its input. Exact for an input that is straight between two samples, so the rate does
    not matter; at rest on the first sample.
    """
    constant = shape[0]
    for i in range(len(now)):
        time, value = now[i, 0], now[i, 1]
        past = time - state[1] if state[0] else 0.0
        if past > 0.0:
            steady = constant * (value - state[2]) / past  # how far it stays behind a ramp
            state[3] = (state[3] + steady) * np.exp(-past / constant) - steady
        state[0], state[1], state[2] = 1.0, time, value
        rows[i, 0] = state[3]


AT_REST = (0.0, 0.0, 0.0, 0.0)
"""State of `behind` before the first sample."""
