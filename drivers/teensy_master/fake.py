"""The master's fake: a grasper's board whose potentiometers a hand turns slowly to and fro."""

import numpy as np
from numpy.typing import NDArray

from drivers.device import Device
from drivers.teensy.control import Controllers
from drivers.teensy.fake import PythonBoard
from drivers.teensy.grasper import GRASPER
from drivers.teensy.logic import GRASPER_LOGIC
from drivers.teensy_master.driver import TeensyMaster
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import SimulatedTransport

MIDDLE, REACH, TURN_HZ = 2048, 300.0, (0.5, 0.3, 0.7)


class TurnedByHand:
    """Implements `drivers.teensy.logic.Bench`; motors stand, potentiometers turn."""

    def __init__(self) -> None:
        self._ticks = 0

    def advance(self, setpoints: NDArray[np.int32], controllers: Controllers) -> NDArray[np.int32]:
        """Return the rows of the next ticks; commands move nothing."""
        time_s = (self._ticks + np.arange(len(setpoints))) * GRASPER.tick_us * 1e-6
        self._ticks += len(setpoints)
        turned = np.sin(2 * np.pi * np.outer(time_s, TURN_HZ))
        pots = np.round(MIDDLE + REACH * turned).astype(np.int32)
        still = np.zeros_like(pots)
        commands = controllers.commands(setpoints, still, still)
        return np.hstack([still, still, pots, commands])


def open_fake(faults: Faults) -> Device:
    """Open the master on a fake board behind a cable with faults."""
    board = PythonBoard(TurnedByHand(), logic=GRASPER_LOGIC)
    link = SimulatedTransport(board, "sim://teensy-master", tick_s=GRASPER.tick_us * 1e-6)
    return TeensyMaster(FaultyTransport(link, faults))
