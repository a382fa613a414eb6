"""The logger's fake as a device: a board whose motors have no supply, its shaft moved by hand."""

import numpy as np
from numpy.typing import NDArray

from drivers.device import Device
from drivers.teensy.control import control_tick
from drivers.teensy.device import TeensyDevice
from drivers.teensy.fake import (
    COMMAND_E4,
    CURRENT,
    DISTAL,
    FSR,
    JAW,
    LOAD_MA,
    MOTOR,
    PROXIMAL,
    SPINDLE,
    TeensyFake,
)
from drivers.teensy.limits import first_breach
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import SimulatedTransport


class HandMovedBench:
    """Implements `drivers.teensy.fake.Bench`; what the controller commands moves nothing."""

    def __init__(self) -> None:
        self._ticks = 0

    def advance(
        self,
        ticks: int,
        target: NDArray[np.int32],
        load_ma: NDArray[np.int32],
        armed: bool,
        control_state: NDArray[np.float64],
        gains: NDArray[np.float64],
        limits: NDArray[np.int32],
    ) -> NDArray[np.int32]:
        """Turn the shaft to and fro once a second; see `drivers.teensy.fake.Bench.advance`."""
        time_s = (self._ticks + np.arange(ticks)) * 1e-3
        self._ticks += ticks
        turn = np.sin(2 * np.pi * time_s)
        counts = np.zeros((ticks, 9), np.int32)
        counts[:, MOTOR] = 3500 * turn
        counts[:, SPINDLE] = -200 * turn
        counts[:, JAW] = 80 * turn
        counts[:, PROXIMAL] = 900 * turn
        counts[:, DISTAL] = -700 * turn
        counts[:, CURRENT] = 3 * np.cos(2 * np.pi * 50 * time_s)
        counts[:, FSR] = 300 * np.maximum(turn, 0.0)
        obeyed = first_breach(limits, counts) if armed else 0
        counts[:obeyed, LOAD_MA] = load_ma[:obeyed]
        for tick in range(obeyed):
            counts[tick, COMMAND_E4] = control_tick(
                control_state, gains, target[tick], counts[tick, SPINDLE], counts[tick, MOTOR]
            )
        return counts


def open_fake(faults: Faults) -> Device:
    """Open the device on a fake board behind a cable with faults."""
    board = SimulatedTransport(TeensyFake(HandMovedBench()), "sim://teensy")
    return TeensyDevice(FaultyTransport(board, faults))
