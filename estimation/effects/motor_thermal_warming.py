"""Thermal torque loss over a run: a torque constant that settles to its warm value."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import Parameter, Remembering
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), the time of the first."""
    for i in range(len(now)):
        if not state[0]:
            state[0], state[1] = 1.0, now[i, 0]
        rows[i, 0] = now[i, 1] * (1.0 - np.exp(-(now[i, 0] - state[1]) / shape[0]))


class WarmingLoss(Remembering):
    """The torque constant settles to its warm value, whatever the source of heat.

    Equation: loss = c current (1 - exp(-t / T)), t from the first sample of the run. current in A,
    c in N m/A, T in s.

    Check: repeat a run at once and after the motor has cooled.

    Source: Newton's law of cooling under a steady mean load, and a magnet's remanence that falls in
    proportion to its temperature.
    """

    id = "motor.thermal.warming"
    family = "motor.thermal"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"clock": "time_s", "current": "motor_current_a"}
    amplitudes = (
        Parameter("loss", "target / current", "fall of the torque constant, warm", lower=0.0),
    )
    shape = (Parameter("time_constant", "clock", "thermal time constant", 0.5, 100.0, points=6),)
    walk = _walk
    rest = (0.0, 0.0)
    told_apart_by = "a run repeated immediately, and again after the motor has cooled"
