"""A tick of the plain simulated board on the reference rig: its loop, without any guard."""

import numba
import numpy as np
from numpy.typing import NDArray

from drivers.teensy.control import control_tick
from drivers.teensy.logic import ENGAGED, STATE, BoardLogic
from drivers.teensy.protocol import STATUS_ARMED
from drivers.teensy.reference import INPUT_NAMES, REFERENCE

(
    MOTOR, SPINDLE, JAW, PROXIMAL, DISTAL, CURRENT, FSR, COMMAND_E4, LOAD_MA, TARGET, STATUS,
) = range(11)  # fmt: skip
"""Columns of a tick's row: seven inputs, what the motors got, the target and the board's state."""
COLUMNS = 11
INT16 = (-(2**15), 2**15 - 1)
FSR_MAX = 4095


@numba.njit(cache=True)
def drive_tick(
    row: NDArray[np.int32],
    target: int,
    load_ma: int,
    state: NDArray[np.int64],
    control_state: NDArray[np.float64],
    gains: NDArray[np.float64],
) -> None:
    """Command the motors behind the inputs in `row`.

    Args:
        row: One row of `COLUMNS` counts; the inputs are read, the rest is written.
        target: Target of the spindle, counts, followed when armed and engaged.
        load_ma: Current of the load motor, mA, likewise.
        state: See `Drive`; so are the others.
        control_state: Shape (1, 4).
        gains: Shape (1, 5).
    """
    row[COMMAND_E4] = 0
    row[LOAD_MA] = 0
    row[TARGET] = row[SPINDLE]
    if state[STATE] & STATUS_ARMED and state[ENGAGED]:
        row[TARGET] = target
        row[COMMAND_E4] = control_tick(control_state[0], gains[0], target, row[SPINDLE], row[MOTOR])
        row[LOAD_MA] = load_ma
    row[STATUS] = state[STATE]


_FIELDS = (*INPUT_NAMES, "fsr", "command_e4", "load_ma", "target")
"""Fields of a sample, in the order of the columns."""

REFERENCE_LOGIC = BoardLogic(
    profile=REFERENCE,
    columns={name: column for column, name in enumerate(_FIELDS)},
    status_column=STATUS,
    converted={PROXIMAL: INT16, DISTAL: INT16, CURRENT: INT16, FSR: (-(2**32), FSR_MAX)},
)
"""What `drivers.teensy.fake.PythonBoard` does a tick on the reference rig."""
