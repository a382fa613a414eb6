"""A bench without physics behind a board: its counts are given."""

import ctypes

import numpy as np
from numpy.typing import NDArray

TICK_FUNCTION = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_void_p, ctypes.c_void_p
)


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
