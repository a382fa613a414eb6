"""The simulated rig: repeatable by seed, its physics, and the counts of its sensors."""

import itertools
from dataclasses import fields, replace

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from drivers.teensy import control
from drivers.teensy.control import Controllers
from rig.protocols import trajectory
from rig.simulation import places, sensors
from rig.simulation.bench import BenchInputError, SimulatedBench
from rig.simulation.hidden import NAMES, HiddenEffect
from rig.simulation.parameters import REFERENCE_GAINS, PlantParameters, SensorParameters, vary

pytestmark = pytest.mark.integration

GAINS = np.array(REFERENCE_GAINS)
TICKS = 600
TARGET = np.round(683 * (1 + np.cos(2 * np.pi * 0.5e-3 * np.arange(TICKS)))).astype(np.int32)
PLAN = np.column_stack((TARGET, np.full(TICKS, 400, np.int32)))


def nothing(ticks: int) -> NDArray[np.int32]:
    """Setpoints that ask for nothing."""
    return np.zeros((ticks, 2), np.int32)


def run(seed: int, cuts: tuple[int, ...] = (), **options: object) -> tuple[np.ndarray, np.ndarray]:
    """Counts and final state of one run, advanced in pieces."""
    bench = SimulatedBench(seed=seed, **options)
    controllers = Controllers.fresh(GAINS)
    edges = [0, *sorted(cuts), TICKS]
    parts = [bench.advance(PLAN[a:b], controllers) for a, b in itertools.pairwise(edges)]
    return np.concatenate(parts), bench.state


@settings(max_examples=25)
@given(st.lists(st.integers(0, TICKS), max_size=8))
def test_a_seed_gives_the_same_bytes_however_the_run_is_cut(cuts):
    effects = [HiddenEffect(name) for name in NAMES]  # every state there is
    whole, whole_state = run(1, effects=effects)
    pieces, pieces_state = run(1, tuple(cuts), effects=effects)
    assert pieces.tobytes() == whole.tobytes() != run(2, effects=effects)[0].tobytes()
    assert pieces_state.tobytes() == whole_state.tobytes()


def test_sensors_are_sampled_before_the_command_acts():
    rows = SimulatedBench().advance(nothing(2), Controllers.fresh(GAINS))
    at_rest = SimulatedBench().advance(nothing(2), Controllers.idle())
    np.testing.assert_array_equal(rows[0, :7], at_rest[0, :7])
    assert rows[0, 7] != 0
    assert rows[1, 5] > rows[0, 5] + 100  # the current has answered one tick later


def test_a_board_at_no_address_is_refused():
    with pytest.raises(BenchInputError, match="address 0x0"):
        SimulatedBench().advance_with_board(5, 0, 0, 0)


@numba.cfunc("void(CPointer(float64), uint32, CPointer(int32), CPointer(int32))")
def controlling_board(board, tick_us, inputs, outputs):
    """A board that plays a cosine of its own clock through the shared controller."""
    memory = numba.carray(board, 9)
    counts = numba.carray(inputs, 7)
    answer = numba.carray(outputs, 2)
    target = np.round(683 * (1 + np.cos(2 * np.pi * 0.5e-3 * (tick_us // 1000))))
    answer[0] = control.control_tick(memory[:4], memory[4:], int(target), counts[1], counts[0])
    answer[1] = 400


def test_a_board_called_by_pointer_closes_the_same_loop():
    _, expected = run(2)
    bench = SimulatedBench(seed=2)
    memory = np.concatenate([np.zeros(4), GAINS])
    address = controlling_board.address
    bench.advance_with_board(250, address, memory.ctypes.data, 0)
    bench.advance_with_board(TICKS - 250, address, memory.ctypes.data, 250_000)
    assert bench.state.tobytes() == expected.tobytes()
    assert bench.ticks_done == TICKS


LOSSES = ("friction", "viscous", "damping")
FREE = PlantParameters(
    **{i.name: 0.0 for i in fields(PlantParameters) if any(loss in i.name for loss in LOSSES)}
)
"""A rig that loses nothing."""


def energy_j(state: NDArray[np.float64], p: PlantParameters) -> float:
    """Kinetic energy of the three bodies and elastic energy of gear and cable."""
    twist = state[places.MOTOR_ANGLE] / p.gear_ratio - state[places.SPINDLE_ANGLE]
    stretch = p.cable_ratio * state[places.SPINDLE_ANGLE] + p.jaw_zero_rad - state[places.JAW_ANGLE]
    return 0.5 * float(
        p.rotor_inertia_kg_m2 * state[places.MOTOR_SPEED] ** 2
        + p.spindle_inertia_kg_m2 * state[places.SPINDLE_SPEED] ** 2
        + p.jaw_inertia_kg_m2 * state[places.JAW_SPEED] ** 2
        + p.gear_stiffness_n_m_rad * twist**2
        + p.cable_stiffness_n_m_rad * stretch**2
    )


def let_go(parameters: PlantParameters, place: int, by_rad: float, ticks: int) -> list[np.ndarray]:
    """Displace one body, let go with the motor off, and return the state tick by tick."""
    bench = SimulatedBench(parameters, start_count=683)
    bench._state[place] += by_rad
    states = [bench.state]
    for _ in range(ticks):
        bench.advance(nothing(1), Controllers.idle())
        states.append(bench.state)
    return states


def energies_after_a_pluck(parameters: PlantParameters, ticks: int) -> NDArray[np.float64]:
    states = let_go(parameters, places.JAW_ANGLE, -0.1, ticks)
    return np.array([energy_j(state, parameters) for state in states])


def test_energy_is_kept_when_nothing_dissipates():
    energies = energies_after_a_pluck(FREE, 2000)
    assert energies[0] == pytest.approx(0.5 * 0.751 * 0.1**2)
    np.testing.assert_allclose(energies, energies[0], rtol=0.03)


def test_energy_only_falls_with_the_motor_off():
    energies = energies_after_a_pluck(PlantParameters(), 500)
    assert np.all(np.diff(energies) <= 1e-12)
    assert energies[-1] < 0.2 * energies[0]


def test_the_proximal_sensor_sees_the_drive_unit_from_outside():
    """With the spindle clamped a swinging rotor gives T / N of the gear's torque T back."""
    clamped = replace(FREE, spindle_friction_n_m=10.0)
    states = np.array(let_go(clamped, places.MOTOR_ANGLE, 0.5, 1000))[1:].T
    twist = states[places.MOTOR_ANGLE] / 35.0 - states[places.SPINDLE_ANGLE]
    gear_n_m = np.std(clamped.gear_stiffness_n_m_rad * twist)
    assert gear_n_m > 0.04
    seen_n_m = np.std(states[places.PROXIMAL_TORQUE])
    assert seen_n_m / gear_n_m == pytest.approx(1.0 - 1.0 / 35.0, abs=0.004)


def test_closing_torque_balances_load_ratio_and_friction():
    bench = SimulatedBench(start_count=1000)
    p = bench.parameters
    start_rad, speed_rad_s, load_a = -1000 * 2 * np.pi / 8192, 0.2, 0.5
    ramp = start_rad + speed_rad_s * trajectory.times(2.5)
    bench.play(ramp, np.full(ramp.size, load_a))
    state = bench.state
    load = p.load_torque_n_m_a * load_a + p.load_friction_n_m
    cable = load + p.jaw_friction_n_m
    at_spindle = (p.cable_ratio + p.cable_load_friction_ratio) * cable + p.spindle_friction_n_m
    at_motor = at_spindle / p.gear_ratio + p.motor_friction_n_m
    assert state[places.JAW_SPEED] == pytest.approx(p.cable_ratio * speed_rad_s, rel=0.05)
    assert state[places.DISTAL_TORQUE] == pytest.approx(load, rel=1e-6)
    assert state[places.PROXIMAL_TORQUE] == pytest.approx(at_spindle, rel=0.02)
    assert state[places.CURRENT] * p.torque_constant_n_m_a == pytest.approx(at_motor, rel=0.04)


def test_friction_holds_without_creep_or_chatter():
    bench = SimulatedBench(start_count=1000)
    rest_rad = -1000 * 2 * np.pi / 8192
    closing = trajectory.minimum_jerk(rest_rad, rest_rad + 0.4, 1.0)
    bench.play(closing, np.full(closing.size, 0.1))
    bench.advance(nothing(300), Controllers.idle())
    before = bench.state
    bench.advance(nothing(300), Controllers.idle())
    after = bench.state
    moving = [places.MOTOR_SPEED, places.SPINDLE_SPEED, places.JAW_SPEED]
    standing = [places.MOTOR_ANGLE, places.SPINDLE_ANGLE, places.JAW_ANGLE]
    np.testing.assert_array_equal(after[moving], 0.0)
    np.testing.assert_array_equal(after[standing], before[standing])
    assert after[places.PROXIMAL_TORQUE] != 0.0  # friction holds the stored torque


@pytest.mark.parametrize("load_a", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("frequency_hz", [0.1, 0.5])
def test_the_controller_follows_the_reference_sinusoid(frequency_hz, load_a):
    target = trajectory.sine(10.0, -np.pi / 3, np.pi / 6, frequency_hz)
    columns = SimulatedBench().play(target, np.full(target.size, load_a))
    error_rad = (columns["target_angle_rad"] - columns["spindle_angle_rad"])[1000:]
    assert np.degrees(np.sqrt(np.mean(error_rad**2))) < 0.7
    assert np.degrees(np.abs(error_rad).max()) < 2.5
    # no limit cycle: the command moves by little more than its own quanta from tick to tick
    assert np.std(np.diff(columns["motor_command_ratio"][1000:])) < 20e-4


def test_the_drive_limits_its_current():
    bench = SimulatedBench(start_count=0)
    far = nothing(200) + np.array([-20000, 0], np.int32)
    gains = np.array([20.0, 0.0, 0.0, 1.0, 10000.0])
    bench.advance(far, Controllers.fresh(gains))
    assert bench.state[places.CURRENT] == pytest.approx(0.56)


def test_vary_is_seeded_and_keeps_scales():
    base = PlantParameters()
    assert vary(base, 3) == vary(base, 3) != vary(base, 4)
    assert vary(base, 3, 0.0) == base
    varied = vary(base, 3, 0.1)
    for item in fields(base):
        old, new = getattr(base, item.name), getattr(varied, item.name)
        assert (old != new) == item.metadata.get("varies", True)
        assert old == new or abs(np.log(new / old)) <= 0.3 + 1e-12
    assert vary(SensorParameters(), 3).torque_n_m_per_count == 0.000039811


def test_a_finer_step_gives_the_same_motion():
    target = trajectory.sine(4.0, -np.pi / 3, np.pi / 6, 0.5)
    load = np.full(target.size, 0.5)
    runs = [
        SimulatedBench(replace(PlantParameters(), substeps_ratio=steps)).play(target, load)
        for steps in (20.0, 80.0)
    ]
    for name in ("spindle_angle_rad", "jaw_angle_rad"):
        np.testing.assert_allclose(runs[0][name], runs[1][name], atol=3e-3)
    assert np.std(runs[0]["proximal_torque_n_m"] - runs[1]["proximal_torque_n_m"]) < 2e-3


QUIET = SensorParameters(
    **{
        item.name: 0.0
        for item in fields(SensorParameters)
        if item.name.split("_")[1] in ("noise", "offset", "ramp", "walk")
    }
)


def rest(parameters: SensorParameters, ticks: int) -> np.ndarray:
    """Counts of the disarmed rig at rest."""
    return SimulatedBench(None, parameters).advance(nothing(ticks), Controllers.idle())


def test_channels_are_closing_positive_and_agree():
    target = trajectory.sine(4.0, -np.pi / 3, np.pi / 6, 0.25)
    columns = SimulatedBench(sensors_parameters=QUIET).play(target, np.full(4000, 0.5))
    close = slice(600, 1500)
    for name in ("spindle_angle_rad", "motor_angle_rad", "jaw_angle_rad", "target_angle_rad"):
        assert columns[name][close][-1] > columns[name][close][0]
    for name in ("proximal_torque_n_m", "distal_torque_n_m", "motor_current_a"):
        assert np.all(columns[name][close] > 0)
    twist = columns["motor_angle_rad"] / 35.0 - columns["spindle_angle_rad"]
    assert np.abs(twist).max() < 0.04
    measured = columns["motor_current_a"][1:]
    commanded = 2.06 * columns["motor_command_ratio"][:-1]
    np.testing.assert_allclose(measured, commanded, atol=0.02)
    assert np.corrcoef(measured, commanded)[0, 1] > 0.999


def test_noise_has_the_stated_size_and_channels_are_unrelated():
    rows = rest(SensorParameters(torque_walk_n_m_s=0.0), 50_000).astype(float)
    noisy = rows[:, [sensors.PROXIMAL, sensors.DISTAL, sensors.CURRENT, sensors.FSR]]
    stated = np.array([0.29e-3 / 0.000039811, 0.22e-3 / 0.000039811, 5.0])
    np.testing.assert_allclose(noisy.std(axis=0)[:3], stated, rtol=0.05)
    related = np.corrcoef(noisy.T) - np.eye(4)
    assert np.abs(related).max() < 0.03
    centred = noisy - noisy.mean(axis=0)
    follows = np.mean(centred[1:] * centred[:-1], axis=0) / np.var(noisy, axis=0)
    assert np.abs(follows).max() < 0.03


def test_zero_offset_and_drift_show_at_rest():
    drifting = replace(QUIET, proximal_offset_n_m=0.01, proximal_ramp_n_m_s=1e-3)
    torque = rest(drifting, 10_000)[:, sensors.PROXIMAL] * 0.000039811
    assert torque[:200].mean() == pytest.approx(0.0101, abs=1e-4)
    assert torque[-200:].mean() == pytest.approx(0.0199, abs=1e-4)


def test_converters_saturate_at_their_limits():
    narrow = SensorParameters(torque_limit_count=400.0, current_limit_count=50.0)
    close = np.round(1366 - 0.4 * np.arange(1000))
    setpoints = np.column_stack((close, np.full(1000, 500))).astype(np.int32)
    rows = SimulatedBench(None, narrow).advance(setpoints, Controllers.fresh(GAINS))
    assert rows[:, sensors.PROXIMAL].max() == 400
    assert rows[:, sensors.DISTAL].min() == -401
    assert rows[:, sensors.CURRENT].max() == 50
    assert rest(SensorParameters(fsr_offset_count=-10.0), 100)[:, sensors.FSR].min() == 0
    assert rest(SensorParameters(fsr_offset_count=5000.0), 100)[:, sensors.FSR].max() == 4095
