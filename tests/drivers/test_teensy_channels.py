"""What is wired to the logger: counts to units by the numbers of the parts."""

import math

import numpy as np
import pytest

from drivers.teensy import channels
from drivers.teensy.device import TeensyDevice
from drivers.teensy.fake import PythonBoard
from drivers.teensy.fake_device import HandMovedBench
from drivers.teensy.reference import SAMPLE_DTYPE
from drivers.transport.simulated import SimulatedTransport


def sample(**fields: int) -> np.ndarray:
    samples = np.zeros(1, SAMPLE_DTYPE)
    for name, value in fields.items():
        samples[name] = value
    return samples


def test_parts_become_units() -> None:
    spindle = channels.quadrature("spindle_angle_rad", "spindle", 8192, falls_on_closing=True)
    assert spindle.values(sample(spindle=-2048))[0] == pytest.approx(math.pi / 2)
    torque = channels.torque_cell("torque_n_m", "proximal", 39.811e-6, zero_count=100)
    assert torque.values(sample(proximal=1100))[0] == pytest.approx(0.039811)
    current = channels.motor_current("current_a", "current", (100, 0.0), (2148, 2.0))
    assert current.values(sample(current=1124))[0] == pytest.approx(1.0)
    pot = channels.potentiometer("angle_rad", "fsr", math.pi)
    assert (pot.channel.lower, pot.channel.upper) == pytest.approx((-math.pi / 2, math.pi / 2))
    force = channels.force_resistor("force_n", "fsr", 1e-6, 100e3, 1.1)
    assert force.values(sample(fsr=4095))[0] == pytest.approx(3.3 / (1.1 * 100e3 * 1e-6))
    assert force.channel.unit == "N"


def test_a_line_needs_a_field_and_a_slope() -> None:
    with pytest.raises(ValueError, match="no field 'elbow'"):
        channels.linear("elbow", "elbow")
    for slope in (0.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="no line"):
            channels.linear("motor", "motor", slope=slope)


def test_the_device_gives_what_is_wired() -> None:
    wired = [
        channels.quadrature("motor_angle_rad", "motor", 4096),
        channels.torque_cell("torque_n_m", "distal", -39.811e-6),
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
