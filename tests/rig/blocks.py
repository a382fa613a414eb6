"""Blocks of samples for the tests of the live display."""

from typing import Any

import numpy as np

from rig.live.block import DeviceStatus, SampleBlock

GRIP = "distal_torque_n_m"


def block(
    first: int,
    n: int = 50,
    sensor: float = 0.1,
    estimate: float | None = None,
    rate_hz: float = 1000.0,
    **changes: Any,
) -> SampleBlock:
    """Return n samples of grip torque, and of its estimate, from sample number `first` on."""
    parts: dict[str, Any] = {
        "time_s": (first + np.arange(n)) / rate_hz,
        "columns": {GRIP: np.full(n, sensor)},
        "flags": np.zeros(n, np.uint8),
        "estimates": {} if estimate is None else {GRIP: np.full(n, estimate)},
        "lost": 0,
        "devices": (DeviceStatus("teensy", "ok"),),
    }
    return SampleBlock(**parts | changes)
