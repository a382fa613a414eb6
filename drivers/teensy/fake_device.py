"""The logger's fake as a device: a board whose motors have no supply, its shaft moved by hand."""

import numpy as np
from numpy.typing import NDArray

from drivers.device import Device
from drivers.teensy.control import Controllers
from drivers.teensy.device import TeensyDevice
from drivers.teensy.fake import PythonBoard
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import SimulatedTransport


class HandMovedBench:
    """Implements `drivers.teensy.logic.Bench`; what the controller commands moves nothing."""

    def __init__(self) -> None:
        self._ticks = 0

    def advance(self, setpoints: NDArray[np.int32], controllers: Controllers) -> NDArray[np.int32]:
        """Turn the shaft to and fro once a second; see `drivers.teensy.logic.Bench.advance`."""
        time_s = (self._ticks + np.arange(len(setpoints))) * 1e-3
        self._ticks += len(setpoints)
        turn = np.sin(2 * np.pi * time_s)
        current = 3 * np.cos(2 * np.pi * 50 * time_s)
        fsr = 300 * np.maximum(turn, 0.0)
        motor, spindle, *others = (size * turn for size in (3500, -200, 80, 900, -700))
        inputs = np.stack([motor, spindle, *others, current, fsr], axis=1).astype(np.int32)
        commands = controllers.commands(setpoints[:, [0]], inputs[:, [1]], inputs[:, [0]])
        return np.hstack([inputs, commands])


def open_fake(faults: Faults) -> Device:
    """Open the device on a fake board behind a cable with faults."""
    board = SimulatedTransport(PythonBoard(HandMovedBench()), "sim://teensy")
    return TeensyDevice(FaultyTransport(board, faults))
