"""The physics: energy, statics, sticking, stops, and the seeds that vary it."""

from dataclasses import fields, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.teensy.logic import Drive
from rig.protocols import trajectory
from rig.simulation import places
from rig.simulation.bench import SimulatedBench
from rig.simulation.parameters import PlantParameters, SensorParameters, vary

pytestmark = pytest.mark.integration

FREE = PlantParameters(
    motor_friction_n_m=0.0,
    motor_viscous_n_m_s_rad=0.0,
    gear_damping_n_m_s_rad=0.0,
    spindle_friction_n_m=0.0,
    spindle_viscous_n_m_s_rad=0.0,
    cable_load_friction_ratio=0.0,
    cable_damping_n_m_s_rad=0.0,
    jaw_friction_n_m=0.0,
    jaw_viscous_n_m_s_rad=0.0,
    load_friction_n_m=0.0,
)
"""A rig that loses nothing."""


def energy_j(state: NDArray[np.float64], p: PlantParameters, gear_error_rad: float = 0.0) -> float:
    """Kinetic energy of the three bodies and elastic energy of gear and cable."""
    twist = state[places.MOTOR_ANGLE] / p.gear_ratio - state[places.SPINDLE_ANGLE] + gear_error_rad
    stretch = p.cable_ratio * state[places.SPINDLE_ANGLE] + p.jaw_zero_rad - state[places.JAW_ANGLE]
    return 0.5 * float(
        p.rotor_inertia_kg_m2 * state[places.MOTOR_SPEED] ** 2
        + p.spindle_inertia_kg_m2 * state[places.SPINDLE_SPEED] ** 2
        + p.jaw_inertia_kg_m2 * state[places.JAW_SPEED] ** 2
        + p.gear_stiffness_n_m_rad * twist**2
        + p.cable_stiffness_n_m_rad * stretch**2
    )


def energies_after_a_pluck(parameters: PlantParameters, ticks: int) -> NDArray[np.float64]:
    """Stretch the cable by 0.1 rad, let go with the motor off, and return energy tick by tick."""
    bench = SimulatedBench(parameters, start_count=683)
    bench._state[places.JAW_ANGLE] -= 0.1
    none, drive = np.zeros(1, np.int32), Drive.idle()
    energies = [energy_j(bench.state, parameters)]
    for _ in range(ticks):
        bench.advance(1, none, none, drive)
        energies.append(energy_j(bench.state, parameters))
    return np.array(energies)


def test_energy_is_kept_when_nothing_dissipates() -> None:
    energies = energies_after_a_pluck(FREE, 2000)
    assert energies[0] == pytest.approx(0.5 * 0.751 * 0.1**2)
    np.testing.assert_allclose(energies, energies[0], rtol=0.03)


def test_the_proximal_sensor_sees_the_drive_unit_from_outside() -> None:
    """With the spindle clamped a swinging rotor gives T / N of the gear's torque T back."""
    clamped = replace(FREE, spindle_friction_n_m=10.0)
    bench = SimulatedBench(clamped, start_count=683)
    bench._state[places.MOTOR_ANGLE] += 0.5
    none, drive = np.zeros(1, np.int32), Drive.idle()
    seen, gear = [], []
    for _ in range(1000):
        bench.advance(1, none, none, drive)
        now = bench.state
        twist = now[places.MOTOR_ANGLE] / 35.0 - now[places.SPINDLE_ANGLE]
        seen.append(now[places.PROXIMAL_TORQUE])
        gear.append(clamped.gear_stiffness_n_m_rad * twist)
    assert np.std(gear) > 0.04
    assert np.std(seen) / np.std(gear) == pytest.approx(1.0 - 1.0 / 35.0, abs=0.004)


def test_energy_only_falls_with_the_motor_off() -> None:
    energies = energies_after_a_pluck(PlantParameters(), 500)
    assert np.all(np.diff(energies) <= 1e-12)
    assert energies[-1] < 0.2 * energies[0]


def test_closing_torque_balances_load_ratio_and_friction() -> None:
    bench = SimulatedBench(start_count=1000)
    p = bench.parameters
    start_rad, speed_rad_s, load_a = -1000 * 2 * np.pi / 8192, 0.2, 0.5
    ramp = start_rad + speed_rad_s * trajectory.times(2.5)
    bench.play(ramp, np.full(ramp.size, load_a))
    state = bench.state
    cable = p.load_torque_n_m_a * load_a + p.load_friction_n_m + p.jaw_friction_n_m
    at_spindle = (
        p.cable_ratio * cable + p.spindle_friction_n_m + p.cable_load_friction_ratio * cable
    )
    at_motor = at_spindle / p.gear_ratio + p.motor_friction_n_m
    assert state[places.JAW_SPEED] == pytest.approx(p.cable_ratio * speed_rad_s, rel=0.05)
    assert state[places.DISTAL_TORQUE] == pytest.approx(
        p.load_torque_n_m_a * load_a + p.load_friction_n_m, rel=1e-6
    )
    assert state[places.PROXIMAL_TORQUE] == pytest.approx(at_spindle, rel=0.02)
    assert state[places.CURRENT] * p.torque_constant_n_m_a == pytest.approx(at_motor, rel=0.04)


def test_friction_holds_without_creep_or_chatter() -> None:
    bench = SimulatedBench(start_count=1000)
    rest_rad = -1000 * 2 * np.pi / 8192
    closing = trajectory.minimum_jerk(rest_rad, rest_rad + 0.4, 1.0)
    bench.play(closing, np.full(closing.size, 0.1))
    idle, drive = np.zeros(300, np.int32), Drive.idle()
    bench.advance(300, idle, idle, drive)
    before = bench.state
    bench.advance(300, idle, idle, drive)
    after = bench.state
    moving = [places.MOTOR_SPEED, places.SPINDLE_SPEED, places.JAW_SPEED]
    standing = [places.MOTOR_ANGLE, places.SPINDLE_ANGLE, places.JAW_ANGLE]
    np.testing.assert_array_equal(after[moving], 0.0)
    np.testing.assert_array_equal(after[standing], before[standing])
    assert after[places.PROXIMAL_TORQUE] != 0.0  # friction holds the stored torque


@pytest.mark.parametrize("load_a", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("frequency_hz", [0.1, 0.5])
def test_the_controller_follows_the_reference_sinusoid(frequency_hz: float, load_a: float) -> None:
    target = trajectory.sine(10.0, -np.pi / 3, np.pi / 6, frequency_hz)
    columns = SimulatedBench().play(target, np.full(target.size, load_a))
    error_rad = (columns["target_angle_rad"] - columns["spindle_angle_rad"])[1000:]
    assert np.degrees(np.sqrt(np.mean(error_rad**2))) < 0.7
    assert np.degrees(np.abs(error_rad).max()) < 2.5
    # no limit cycle: the command moves by little more than its own quanta from tick to tick
    assert np.std(np.diff(columns["motor_command_ratio"][1000:])) < 20e-4


def test_the_drive_limits_its_current() -> None:
    bench = SimulatedBench(start_count=0)
    far = np.full(200, -20000, np.int32)
    gains = np.array([20.0, 0.0, 0.0, 1.0, 10000.0])
    bench.advance(200, far, np.zeros(200, np.int32), Drive.armed(gains))
    assert bench.state[places.CURRENT] == pytest.approx(0.56)


def test_vary_is_seeded_and_keeps_scales() -> None:
    base = PlantParameters()
    assert vary(base, 3) == vary(base, 3)
    assert vary(base, 3) != vary(base, 4)
    assert vary(base, 3, 0.0) == base
    varied = vary(base, 3, 0.1)
    for item in fields(base):
        old, new = getattr(base, item.name), getattr(varied, item.name)
        if item.metadata.get("varies", True):
            assert old != new
            assert abs(np.log(new / old)) <= 0.3 + 1e-12
        else:
            assert old == new
    assert vary(SensorParameters(), 3).torque_n_m_per_count == 0.000039811


def test_a_finer_step_gives_the_same_motion() -> None:
    target = trajectory.sine(4.0, -np.pi / 3, np.pi / 6, 0.5)
    load = np.full(target.size, 0.5)
    runs = [
        SimulatedBench(replace(PlantParameters(), substeps_ratio=steps)).play(target, load)
        for steps in (20.0, 80.0)
    ]
    for name, tolerance in (("spindle_angle_rad", 3e-3), ("jaw_angle_rad", 3e-3)):
        np.testing.assert_allclose(runs[0][name], runs[1][name], atol=tolerance)
    torque_rms = np.std(runs[0]["proximal_torque_n_m"] - runs[1]["proximal_torque_n_m"])
    assert torque_rms < 2e-3
