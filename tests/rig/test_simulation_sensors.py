"""Counts: signs, quanta, noise, drift and limits."""

import numpy as np
import pytest

from drivers.teensy.logic import Drive
from rig.protocols import trajectory
from rig.simulation import sensors
from rig.simulation.bench import SimulatedBench
from rig.simulation.parameters import REFERENCE_GAINS, SensorParameters

pytestmark = pytest.mark.integration

GAINS = np.array(REFERENCE_GAINS)
QUIET = SensorParameters(
    proximal_noise_n_m=0.0,
    distal_noise_n_m=0.0,
    proximal_offset_n_m=0.0,
    distal_offset_n_m=0.0,
    proximal_ramp_n_m_s=0.0,
    distal_ramp_n_m_s=0.0,
    torque_walk_n_m_s=0.0,
    current_noise_a=0.0,
    current_offset_a=0.0,
    fsr_noise_count=0.0,
    fsr_offset_count=0.0,
)


def rest(parameters: SensorParameters, ticks: int, seed: int = 0) -> np.ndarray:
    """Counts of the disarmed rig at rest."""
    idle = np.zeros(ticks, np.int32)
    bench = SimulatedBench(sensors_parameters=parameters, seed=seed)
    return bench.advance(ticks, idle, idle, Drive.idle())


def closing(parameters: SensorParameters, load_ma: int = 500) -> np.ndarray:
    """Counts of one second of closing."""
    target = np.round(1366 - 0.4 * np.arange(1000)).astype(np.int32)
    load = np.full(1000, load_ma, np.int32)
    bench = SimulatedBench(sensors_parameters=parameters)
    return bench.advance(1000, target, load, Drive.armed(GAINS))


def test_channels_are_closing_positive_and_agree() -> None:
    target = trajectory.sine(4.0, -np.pi / 3, np.pi / 6, 0.25)
    columns = SimulatedBench(sensors_parameters=QUIET).play(target, np.full(4000, 0.5))
    close = slice(600, 1500)
    for name in ("spindle_angle_rad", "motor_angle_rad", "jaw_angle_rad", "target_angle_rad"):
        assert columns[name][close][-1] > columns[name][close][0]
    loaded = ("proximal_torque_n_m", "distal_torque_n_m", "motor_current_a", "motor_command_ratio")
    for name in loaded:
        assert np.all(columns[name][close] > 0)
    twist = columns["motor_angle_rad"] / 35.0 - columns["spindle_angle_rad"]
    assert np.abs(twist).max() < 0.04
    measured = columns["motor_current_a"][1:]
    commanded = 2.06 * columns["motor_command_ratio"][:-1]
    np.testing.assert_allclose(measured, commanded, atol=0.02)
    assert np.corrcoef(measured, commanded)[0, 1] > 0.999


def test_noise_has_the_stated_size_and_channels_are_unrelated() -> None:
    rows = rest(SensorParameters(torque_walk_n_m_s=0.0), 50_000).astype(float)
    scale = 0.000039811
    assert np.std(rows[:, sensors.PROXIMAL]) * scale == pytest.approx(0.29e-3, rel=0.05)
    assert np.std(rows[:, sensors.DISTAL]) * scale == pytest.approx(0.22e-3, rel=0.05)
    assert np.std(rows[:, sensors.CURRENT]) * 1e-3 == pytest.approx(5e-3, rel=0.05)
    noisy = rows[:, [sensors.PROXIMAL, sensors.DISTAL, sensors.CURRENT, sensors.FSR]]
    related = np.corrcoef(noisy.T) - np.eye(4)
    assert np.abs(related).max() < 0.03
    centred = noisy - noisy.mean(axis=0)
    follows = np.mean(centred[1:] * centred[:-1], axis=0) / np.var(noisy, axis=0)
    assert np.abs(follows).max() < 0.03


def test_zero_offset_and_drift_show_at_rest() -> None:
    drifting = SensorParameters(
        proximal_offset_n_m=0.01,
        proximal_ramp_n_m_s=1e-3,
        distal_ramp_n_m_s=0.0,
        torque_walk_n_m_s=0.0,
    )
    torque = rest(drifting, 10_000)[:, sensors.PROXIMAL] * 0.000039811
    assert torque[:200].mean() == pytest.approx(0.0101, abs=1e-4)
    assert torque[-200:].mean() == pytest.approx(0.0199, abs=1e-4)


def test_converters_saturate_at_their_limits() -> None:
    narrow = SensorParameters(torque_limit_count=400.0, current_limit_count=50.0)
    rows = closing(narrow)
    assert rows[:, sensors.PROXIMAL].max() == 400
    assert rows[:, sensors.DISTAL].min() == -401
    assert rows[:, sensors.CURRENT].max() == 50
    assert rest(SensorParameters(fsr_offset_count=-10.0), 100)[:, sensors.FSR].min() == 0
    assert rest(SensorParameters(fsr_offset_count=5000.0), 100)[:, sensors.FSR].max() == 4095


def test_disarmed_commands_are_zero_and_the_controller_rests() -> None:
    drive = Drive.idle()
    far = np.full(100, -5000, np.int32)
    bench = SimulatedBench()
    rows = bench.advance(100, far, np.full(100, 700, np.int32), drive)
    np.testing.assert_array_equal(rows[:, [sensors.COMMAND_E4, sensors.LOAD_MA]], 0)
    np.testing.assert_array_equal(drive.control_state, 0.0)
    assert np.ptp(rows[:, sensors.SPINDLE]) == 0
