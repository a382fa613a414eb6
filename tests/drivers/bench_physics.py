"""A small physics behind a board, for tests: one inertia, friction, noise from a counter."""

import ctypes

import numba
import numpy as np
from numpy.typing import NDArray

from drivers.teensy.logic import Drive
from drivers.teensy.reference_board import COLUMNS, drive_tick

START_SPINDLE = 1366
MOTOR, VELOCITY, CURRENT_MA, LOAD_MA, TICK = range(5)
TICK_FUNCTION = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_void_p, ctypes.c_void_p
)


@numba.njit(cache=True)
def sample(state, inputs):
    """Sample the seven inputs; the noise depends on the tick alone."""
    noise = ((int(state[TICK]) * 1103515245 + 12345) >> 16) % 7 - 3
    inputs[0] = np.floor(state[MOTOR])
    inputs[1] = np.floor(START_SPINDLE - state[MOTOR] / 17.5)
    inputs[2] = np.floor(state[MOTOR] * 0.02)
    torque = 4.0 * state[CURRENT_MA] + 2.0 * state[LOAD_MA]
    inputs[3] = max(-32768, min(32767, np.floor(torque) + noise))
    inputs[4] = max(-32768, min(32767, -np.floor(0.8 * torque) - noise))
    inputs[5] = max(-32768, min(32767, np.floor(state[CURRENT_MA]) + noise))
    inputs[6] = max(0, min(4095, np.floor(0.4 * torque)))


@numba.njit(cache=True)
def step(state, command_e4, load_ma):
    """Move the physics by 1 ms."""
    state[CURRENT_MA] = -0.206 * command_e4
    state[LOAD_MA] = load_ma
    push = 0.02 * state[CURRENT_MA] - 0.002 * load_ma
    state[VELOCITY] += push - 0.1 * state[VELOCITY]
    state[MOTOR] += state[VELOCITY]
    state[TICK] += 1


@numba.njit  # not cached: the cache does not see changes in the functions of other files
def run(state, rows, target, load_ma, board, control_state, gains):
    """Run closed-loop ticks with the controller inside."""
    for k in range(rows.shape[0]):
        row = rows[k]
        sample(state, row)
        drive_tick(row, target[k], load_ma[k], board, control_state, gains)
        step(state, row[7], row[8])


class PlainBench:
    """Implements `drivers.teensy.fake.Bench` and `drivers.teensy.core.FirmwareBench`."""

    def __init__(self) -> None:
        self.state = np.zeros(5)

    def advance(
        self, ticks: int, target: NDArray[np.int32], load_ma: NDArray[np.int32], drive: Drive
    ) -> NDArray[np.int32]:
        rows = np.empty((ticks, COLUMNS), np.int32)
        run(self.state, rows, target, load_ma, *drive.arrays)
        return rows

    def advance_with_board(
        self, ticks: int, tick_address: int, board_address: int, tick_us: int
    ) -> None:
        tick = TICK_FUNCTION(tick_address)
        inputs, outputs = np.zeros(7, np.int32), np.zeros(2, np.int32)
        for k in range(ticks):
            sample(self.state, inputs)
            tick(
                board_address, (tick_us + 1000 * k) % 2**32, inputs.ctypes.data, outputs.ctypes.data
            )
            step(self.state, outputs[0], outputs[1])


class ScriptedBench:
    """No physics: the inputs of each tick, shape (n, channels), are given; the last ones stay."""

    def __init__(self, inputs: NDArray[np.int32], outputs: int = 2, tick_us: int = 1000) -> None:
        self._inputs = np.ascontiguousarray(inputs, np.int32)
        self._outputs = np.zeros(outputs, np.int32)
        self._tick_us, self._ticks = tick_us, 0

    def advance_with_board(
        self, ticks: int, tick_address: int, board_address: int, tick_us: int
    ) -> None:
        tick = TICK_FUNCTION(tick_address)
        for k in range(ticks):
            inputs = self._inputs[min(self._ticks, len(self._inputs) - 1)]
            clock_us = (tick_us + self._tick_us * k) % 2**32
            tick(board_address, clock_us, inputs.ctypes.data, self._outputs.ctypes.data)
            self._ticks += 1
