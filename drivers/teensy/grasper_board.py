"""A tick of the plain simulated board on the grasper: its position loops, without any guard."""

import numba
import numpy as np
from numpy.typing import NDArray

from drivers.teensy.control import control_tick
from drivers.teensy.grasper import GRASPER
from drivers.teensy.logic import ENGAGED, STATE, BoardLogic
from drivers.teensy.protocol import STATUS_ARMED, TOP

MOTORS = GRASPER.motors
MOTOR, CURRENT, FORCE, COMMAND_E4, TARGET = (MOTORS * k for k in range(5))
STATUS = 5 * MOTORS
"""Columns of a tick's row: of each motor its encoder, current and force, its command and target."""
COLUMNS = STATUS + 1
INPUTS = 3 * MOTORS
INT16 = (-(2**15), 2**15 - 1)
FORCE_MAX = 4095


@numba.njit(cache=True)
def grasper_tick(
    row: NDArray[np.int32],
    targets: NDArray[np.int32],
    state: NDArray[np.int64],
    control_state: NDArray[np.float64],
    gains: NDArray[np.float64],
) -> None:
    """Command the motors behind the inputs in `row`.

    Args:
        row: One row of `COLUMNS` counts; the inputs are read, the rest is written.
        targets: Target of each motor, counts, shape (3,), followed when armed and engaged.
        state: See `Drive`; so are the others.
        control_state: Shape (3, 4).
        gains: Shape (3, 5).
    """
    moving = state[STATE] & STATUS_ARMED and state[ENGAGED]
    for k in range(MOTORS):
        row[COMMAND_E4 + k] = 0
        row[TARGET + k] = row[MOTOR + k]
        if moving:
            row[TARGET + k] = targets[k]
            motor = int(row[MOTOR + k])
            row[COMMAND_E4 + k] = control_tick(
                control_state[k], gains[k], int(targets[k]), motor, motor
            )
    row[STATUS] = state[STATE]


_PARTS = {
    "motor_{}": MOTOR,
    "current_{}": CURRENT,
    "force_{}": FORCE,
    "command_{}_e4": COMMAND_E4,
    "target_{}": TARGET,
}

GRASPER_LOGIC = BoardLogic(
    profile=GRASPER,
    columns={
        name.format(k + 1): column + k for name, column in _PARTS.items() for k in range(MOTORS)
    },
    status_column=STATUS,
    converted={CURRENT + k: INT16 for k in range(MOTORS)}
    | {FORCE + k: (-TOP - 1, FORCE_MAX) for k in range(MOTORS)},
)
"""What `drivers.teensy.fake.PythonBoard` does a tick on the grasper."""
