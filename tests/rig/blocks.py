"""Blocks of samples for the tests of the live display."""

import numpy as np

from rig.live.block import DeviceStatus, SampleBlock

GRIP = "distal_torque_n_m"


def block(first, n=50, sensor=0.1, estimate=None, rate_hz=1000.0, **changes) -> SampleBlock:
    """Return n samples of grip torque, and of its estimate, from sample number `first` on."""
    parts = {
        "time_s": (first + np.arange(n)) / rate_hz,
        "columns": {GRIP: np.full(n, sensor)},
        "flags": np.zeros(n, np.uint8),
        "estimates": {} if estimate is None else {GRIP: np.full(n, estimate)},
        "lost": 0,
        "devices": (DeviceStatus("teensy", "ok"),),
    }
    return SampleBlock(**parts | changes)
