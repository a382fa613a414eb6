"""The position controller of the logger at 1 kHz, in Python (`firmware/core/control.hpp`).

Signs are the rig's raw ones: on closing the spindle count and the command fall while the motor
count rises. Both implementations do the same float64 operations in the same order, so that the
fake and the firmware answer with the same bytes.
"""

import numba
import numpy as np
from numpy.typing import NDArray

INTEGRAL, PREVIOUS_MOTOR_COUNT, MOTOR_VELOCITY, PRIMED = range(4)
"""Places in the controller's state, which begins with zeros."""

KP, KI, KD, VELOCITY_FILTER, LIMIT = range(5)
"""Places in the gains: command ticks a spindle count, command ticks a spindle count and tick,
command ticks a motor count and tick, weight of the newest velocity (0..1), limit in command ticks.
One command tick is 1e-4 of full scale."""


@numba.njit(cache=True)
def control_tick(
    state: NDArray[np.float64],
    gains: NDArray[np.float64],
    target_count: int,
    spindle_count: int,
    motor_count: int,
) -> int:
    """Do one tick of the controller and return the command in ticks of 1e-4 of full scale.

    The state, shape (4,), is changed in place; the gains, shape (5,), are `KP` and the names next
    to it.
    """
    if state[PRIMED] == 0.0:
        state[PREVIOUS_MOTOR_COUNT] = motor_count
        state[PRIMED] = 1.0
    velocity = motor_count - state[PREVIOUS_MOTOR_COUNT]
    state[PREVIOUS_MOTOR_COUNT] = motor_count
    state[MOTOR_VELOCITY] += gains[VELOCITY_FILTER] * (velocity - state[MOTOR_VELOCITY])
    error = float(target_count - spindle_count)
    limit = gains[LIMIT]
    state[INTEGRAL] = min(max(state[INTEGRAL] + gains[KI] * error, -limit), limit)
    command = gains[KP] * error + state[INTEGRAL] + gains[KD] * state[MOTOR_VELOCITY]
    return int(np.floor(min(max(command, -limit), limit) + 0.5))
