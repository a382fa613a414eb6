"""What is wired to the logger: counts to units by the numbers of the parts."""

import math

import numpy as np
import pytest

from drivers.teensy import channels
from drivers.teensy.device import TeensyDevice
from drivers.teensy.fake import PythonBoard
from drivers.teensy.fake_device import HandMovedBench
from drivers.transport.simulated import SimulatedTransport


def test_a_line_needs_a_field_and_a_slope() -> None:
    with pytest.raises(ValueError, match="no field 'elbow'"):
        channels.linear("elbow", "elbow")
    for slope in (0.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="no line"):
            channels.linear("motor", "motor", slope=slope)


def test_the_device_gives_what_is_wired() -> None:
    wired = [
        channels.linear("motor_angle_rad", "motor", "rad", 2 * math.pi / 4096),
        channels.linear("torque_n_m", "distal", "N m", -39.811e-6),
    ]
    device = TeensyDevice(SimulatedTransport(PythonBoard(HandMovedBench())), wired)
    device.start()
    batches = [device.read(0.1) for _ in range(30)]
    angle = np.concatenate([batch.columns["motor_angle_rad"] for batch in batches])
    torque = np.concatenate([batch.columns["torque_n_m"] for batch in batches])
    assert angle.max() == pytest.approx(3500 / 4096 * 2 * math.pi, rel=1e-3)
    assert torque.max() == pytest.approx(700 * 39.811e-6, rel=1e-2)
    assert {batch.clock for batch in batches} == {"device"}
    assert np.allclose(np.diff(np.concatenate([batch.time_s for batch in batches])), 1e-3)
    device.close()
