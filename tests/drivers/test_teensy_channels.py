"""What is wired to the logger, in counts on the board's clock."""

import numpy as np
import pytest

from drivers.teensy.device import TeensyDevice
from drivers.teensy.fake import PythonBoard
from drivers.teensy.fake_device import HandMovedBench
from drivers.transport.simulated import SimulatedTransport


def test_the_device_gives_what_is_wired() -> None:
    device = TeensyDevice(SimulatedTransport(PythonBoard(HandMovedBench())))
    device.start()
    batches = [device.read(0.1) for _ in range(30)]
    largest = {
        name: max(batch.columns[name].max(initial=-np.inf) for batch in batches)
        for name in ("motor_count", "distal_count")
    }
    assert largest["motor_count"] == pytest.approx(3500, rel=1e-3)
    assert largest["distal_count"] > 0
    assert {batch.clock for batch in batches} == {"device"}
    assert np.allclose(np.diff(np.concatenate([batch.time_s for batch in batches])), 1e-3)
    device.close()
