"""The master's fake: a grasper's board whose potentiometers a hand turns slowly to and fro."""

import numpy as np
from numpy.typing import NDArray

from drivers.device import Device
from drivers.teensy.fake import PythonBoard
from drivers.teensy.grasper import GRASPER
from drivers.teensy.grasper_board import COLUMNS, GRASPER_LOGIC, INPUTS, grasper_tick
from drivers.teensy.logic import Drive
from drivers.teensy_master.driver import TeensyMaster
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import SimulatedTransport

MIDDLE, REACH, TURN_HZ = 2048, 300.0, (0.5, 0.3, 0.7)


class TurnedByHand:
    """Implements the bench of a grasper's board; motors stand, potentiometers turn."""

    def __init__(self) -> None:
        self._ticks = 0

    def advance(
        self,
        ticks: int,
        one: NDArray[np.int32],
        two: NDArray[np.int32],
        three: NDArray[np.int32],
        drive: Drive,
    ) -> NDArray[np.int32]:
        """Return the rows of the next ticks; commands move nothing."""
        rows = np.zeros((ticks, COLUMNS), np.int32)
        time_s = (self._ticks + np.arange(ticks)) * GRASPER.tick_us * 1e-6
        self._ticks += ticks
        for k, turn_hz in enumerate(TURN_HZ):
            turned = np.sin(2 * np.pi * turn_hz * time_s)
            rows[:, INPUTS - 3 + k] = np.round(MIDDLE + REACH * turned)
        for row, targets in zip(rows, np.column_stack((one, two, three)), strict=True):
            grasper_tick(row, targets, *drive.arrays)
        return rows


def open_fake(faults: Faults) -> Device:
    """Open the master on a fake board behind a cable with faults."""
    board = PythonBoard(TurnedByHand(), logic=GRASPER_LOGIC)
    link = SimulatedTransport(board, "sim://teensy-master", tick_s=GRASPER.tick_us * 1e-6)
    return TeensyMaster(FaultyTransport(link, faults))
