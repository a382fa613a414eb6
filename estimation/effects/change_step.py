"""Friction change within a run: Coulomb friction that changes at one instant of a run."""

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
            state[0], state[1] = 1.0, now[i, 1]
        after = 1.0 if now[i, 1] - state[1] >= shape[0] else 0.0
        rows[i, 0] = after * np.tanh(now[i, 0] / shape[1])


class FrictionStep(Remembering):
    """A part that comes loose, jams or is released within a run.

    Equation: torque = F tanh(speed / width) for t >= since, t from the run's start. F in N m, width
    in rad/s, since in s.

    Check: inspect screws, cable guides and the gripped object after the run.

    Source: Page 1955 (a change of a parameter at an unknown point).
    """

    id = "change.step"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "clock": "time_s"}
    amplitudes = (Parameter("friction", "target", "loss after the change minus before"),)
    shape = (
        Parameter("since", "clock", "time of the change in its run", 1.0, 30.0, points=10),
        Parameter("width", "speed", "speed at which the tanh reaches 76 %", 1e-2, 50.0, points=4),
    )
    walk = _walk
    rest = (0.0, 0.0)
    told_apart_by = "the run repeated twice as long"
