"""Thermal torque loss: a torque constant that falls with the heat of the current."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import Parameter, Remembering
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), the last time, the last current, the heat."""
    for i in range(len(now)):
        time, current = now[i, 0], now[i, 1]
        past = time - state[1] if state[0] else 0.0
        if past > 0.0:
            power = 0.5 * (state[2] * state[2] + current * current)
            state[3] = power + (state[3] - power) * np.exp(-past / shape[0])
        state[0], state[1], state[2] = 1.0, time, current
        rows[i, 0] = current * state[3]


class ThermalLoss(Remembering):
    """The torque constant falls as the heat of the windings reaches the magnets.

    Equation: loss = c current heat; d heat / dt = (current^2 - heat) / T, heat = 0 at the start.
    current in A, heat in A^2, T in s, c in N m/A^3.

    Check: measure the motor's temperature, and repeat a run at once and after the motor has cooled.

    Source: the one-body thermal model of a motor, IEC 60034-11, and a magnet's remanence that falls
    in proportion to its temperature.
    """

    id = "motor.thermal"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"clock": "time_s", "current": "motor_current_a"}
    amplitudes = (
        Parameter(
            "loss",
            "target / current / current / current",
            "fall of the torque constant per unit of heat",
            lower=0.0,
        ),
    )
    shape = (Parameter("time_constant", "clock", "thermal time constant", 0.3, 300.0, points=8),)
    walk = _walk
    rest = (0.0, 0.0, 0.0, 0.0)
    told_apart_by = "a run repeated immediately, and again after the motor has cooled"
