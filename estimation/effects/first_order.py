"""Output minus input of a first-order lag, shared by the effects with a time constant."""

import numba
import numpy as np

from estimation.recording import FloatArray


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
