"""The logger's fake as a device: a board whose motors have no supply, its shaft moved by hand."""

import numpy as np
from numpy.typing import NDArray

from drivers.device import Device
from drivers.teensy import reference_board as at
from drivers.teensy.device import TeensyDevice
from drivers.teensy.fake import PythonBoard
from drivers.teensy.logic import Drive
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import SimulatedTransport


class HandMovedBench:
    """Implements `drivers.teensy.fake.Bench`; what the controller commands moves nothing."""

    def __init__(self) -> None:
        self._ticks = 0

    def advance(
        self, ticks: int, target: NDArray[np.int32], load_ma: NDArray[np.int32], drive: Drive
    ) -> NDArray[np.int32]:
        """Turn the shaft to and fro once a second; see `drivers.teensy.fake.Bench.advance`."""
        time_s = (self._ticks + np.arange(ticks)) * 1e-3
        self._ticks += ticks
        turn = np.sin(2 * np.pi * time_s)
        counts = np.zeros((ticks, at.COLUMNS), np.int32)
        counts[:, at.MOTOR] = 3500 * turn
        counts[:, at.SPINDLE] = -200 * turn
        counts[:, at.JAW] = 80 * turn
        counts[:, at.PROXIMAL] = 900 * turn
        counts[:, at.DISTAL] = -700 * turn
        counts[:, at.CURRENT] = 3 * np.cos(2 * np.pi * 50 * time_s)
        counts[:, at.FSR] = 300 * np.maximum(turn, 0.0)
        for row, *setpoint in zip(counts, target, load_ma, strict=True):
            at.drive_tick(row, *setpoint, *drive.arrays)
        return counts


def open_fake(faults: Faults) -> Device:
    """Open the device on a fake board behind a cable with faults."""
    board = SimulatedTransport(PythonBoard(HandMovedBench()), "sim://teensy")
    return TeensyDevice(FaultyTransport(board, faults))
