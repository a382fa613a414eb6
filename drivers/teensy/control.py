"""The position controller of the logger at 1 kHz, in Python (`firmware/core/control.hpp`).

Signs are the rig's raw ones: on closing the spindle count and the command fall while the motor
count rises. Both implementations do the same float64 operations in the same order, so that the
fake and the firmware answer with the same bytes.
"""

from dataclasses import dataclass
from typing import Any

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


@dataclass(frozen=True, slots=True, eq=False)
class Controllers:
    """The position controllers of a board's motors."""

    state: NDArray[np.float64]  # state of each, shape (motors, 4); changed in place
    gains: NDArray[np.float64]  # gains of each, shape (motors, 5)

    @classmethod
    def fresh(cls, gains: Any) -> "Controllers":
        """Return controllers at their start, given their gains, (5,) or (motors, 5)."""
        rows = np.atleast_2d(np.array(gains, np.float64))
        return cls(np.zeros((len(rows), 4)), rows)

    @classmethod
    def idle(cls, motors: int = 1) -> "Controllers":
        """Return controllers whose command is always 0."""
        return cls.fresh(np.zeros((motors, 5)))

    def commands(
        self,
        targets: NDArray[np.int32],
        positions: NDArray[np.int32],
        motors: NDArray[np.int32],
    ) -> NDArray[np.int32]:
        """Return the commands along some ticks; all arrays are of shape (n, motors)."""
        found = np.empty_like(targets)
        for tick, counts in enumerate(zip(targets, positions, motors, strict=True)):
            found[tick] = list(map(control_tick, self.state, self.gains, *counts))
        return found
