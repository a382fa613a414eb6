"""What many tests of drivers do: tap a cable, start a device on its fake, gather what it sends."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.transport.faulty import Tap
from drivers.transport.simulated import Board, SimulatedTransport


def once(tap: Tap) -> Tap:
    """Return a tap that acts on the first non-empty bytes only."""
    struck = False

    def strike(data: bytes) -> bytes:
        nonlocal struck
        if struck or not data:
            return data
        struck = True
        return tap(data)

    return strike


def started(driver: Any, board: Board, **options: Any) -> Any:
    device = driver(SimulatedTransport(board), **options)
    device.start()
    return device


def gathered(device: Any, reads: int, timeout_s: float = 0.1) -> tuple[NDArray[np.float64], Any]:
    """Return values, shape (n, channels), and flags, shape (n,), of some readings."""
    batches = [device.read(timeout_s) for _ in range(reads)]
    values = [np.stack([*batch.columns.values()], axis=1) for batch in batches]
    return np.concatenate(values), np.concatenate([batch.flags for batch in batches])
