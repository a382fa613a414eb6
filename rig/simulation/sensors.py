"""From physical quantities to counts, raw signs, and back with the nominal scales.

All channels of a tick are sampled at the same instant, the start of the tick, before the controller
runs; channels have no delay between them. Angles and the current are the state at that instant. The
two torques are those of the physics step that ends there (0.05 ms long), which puts them 0.025 ms
earlier. The command logged in a row acts from that row's instant on, so the current answers it in
the next row.
"""

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from rig.simulation import hidden_sensors, places, plant
from rig.simulation.hidden import STRENGTH
from rig.simulation.noise import normal
from rig.simulation.parameters import SensorParameters

MOTOR, SPINDLE, JAW, PROXIMAL, DISTAL, CURRENT, FSR, COMMAND_E4 = range(8)
"""Columns of a row of counts; the board is given the first seven."""

TURN_RAD = 2.0 * np.pi


@numba.njit()
def _converted(value: float, quantum: float, low: float, high: float) -> int:
    """Return the count a converter gives: rounded to its quantum, held at its limits."""
    return int(min(max(np.floor(value / quantum + 0.5) * quantum, low), high))


@numba.njit()
def sample(
    state: NDArray[np.float64],
    s: Any,
    effects: Any,
    seed: np.uint64,
    tick: int,
    counts: NDArray[np.int32],
) -> None:
    """Write the seven sampled counts of this tick and let the torque zeros drift by one tick.

    Of the plant's state only the drifts and the states of the sensors are changed; s is from
    `parameters.compiled`, the effects are a record of `hidden.table`.
    """
    _drift(state, s, seed, tick)
    counts[MOTOR] = int(np.floor(state[places.MOTOR_ANGLE] / TURN_RAD * s.motor_count_per_turn))
    spindle_turns = -state[places.SPINDLE_ANGLE] / TURN_RAD
    counts[SPINDLE] = int(np.floor(spindle_turns * s.spindle_count_per_turn))
    jaw = state[places.JAW_ANGLE]
    if effects.jaw_encoder_wave[STRENGTH] != 0.0:
        jaw += hidden_sensors.jaw_encoder_wave_rad(effects.jaw_encoder_wave, jaw)
    if effects.jaw_delay[STRENGTH] != 0.0:
        jaw = hidden_sensors.delayed(effects.jaw_delay, state[places.RING :], tick, jaw)
    counts[JAW] = int(np.floor(jaw / TURN_RAD * s.jaw_count_per_turn))

    per_count = 1.0 / s.torque_n_m_per_count
    limit = s.torque_limit_count
    proximal = _proximal_n_m(state, effects) + s.proximal_offset_n_m + state[places.PROXIMAL_DRIFT]
    proximal += s.proximal_noise_n_m * normal(seed, tick, 2)
    proximal += s.torque_colour_n_m * state[places.PROXIMAL_COLOUR]
    distal = _distal_n_m(state, effects) + s.distal_offset_n_m + state[places.DISTAL_DRIFT]
    distal += s.distal_noise_n_m * normal(seed, tick, 3)
    distal += s.torque_colour_n_m * state[places.DISTAL_COLOUR]
    counts[PROXIMAL] = _converted(proximal * per_count, s.torque_quantum_count, -limit - 1.0, limit)
    counts[DISTAL] = _converted(-distal * per_count, s.torque_quantum_count, -limit - 1.0, limit)

    current = state[places.CURRENT]
    if effects.current_sensor_bend[STRENGTH] != 0.0:
        row = effects.current_sensor_bend
        current *= hidden_sensors.bend_ratio(row, current)
    current += s.current_offset_a + s.current_noise_a * normal(seed, tick, 4)
    current += s.current_colour_a * state[places.CURRENT_COLOUR]
    limit = s.current_limit_count
    counts[CURRENT] = _converted(current / s.current_a_per_count, 1.0, -limit - 1.0, limit)

    grip = max(state[places.DISTAL_TORQUE], 0.0) / s.lever_arm_m
    fsr = grip / s.fsr_n_per_count + s.fsr_offset_count + s.fsr_noise_count * normal(seed, tick, 5)
    counts[FSR] = _converted(fsr, 1.0, 0.0, s.fsr_limit_count)


@numba.njit()
def _drift(state: NDArray[np.float64], s: Any, seed: np.uint64, tick: int) -> None:
    """Move the zeros of the torque sensors and the coloured noise by a tick."""
    walk = s.torque_walk_n_m_s * np.sqrt(plant.TICK_S)
    for k in range(2):
        ramp = s.proximal_ramp_n_m_s if k == 0 else s.distal_ramp_n_m_s
        state[places.PROXIMAL_DRIFT + k] += ramp * plant.TICK_S + walk * normal(seed, tick, k)
    if s.torque_colour_n_m != 0.0 or s.current_colour_a != 0.0:
        keep = np.exp(-plant.TICK_S / s.colour_time_s)
        fresh = np.sqrt(1.0 - keep * keep)
        for k in range(3):
            place = places.PROXIMAL_COLOUR + k
            state[place] = keep * state[place] + fresh * normal(seed, tick, 6 + k)


@numba.njit()
def _proximal_n_m(state: NDArray[np.float64], effects: Any) -> float:
    """Return the torque at the spindle as its sensor sees it, with the sensor's hidden effects."""
    seen = state[places.PROXIMAL_TORQUE]
    row = effects.proximal_lag
    if row[STRENGTH] != 0.0:
        memory = state[places.SENSOR_LAG_FIRST :]
        seen = hidden_sensors.proximal_lag_n_m(row, memory, seen, plant.TICK_S)
    row = effects.proximal_creep
    if row[STRENGTH] != 0.0:
        memory = state[places.CREEP_FAST :]
        seen += hidden_sensors.proximal_creep_n_m(row, memory, seen, plant.TICK_S)
    row = effects.proximal_bend
    if row[STRENGTH] != 0.0:
        seen *= hidden_sensors.bend_ratio(row, seen)
    return float(seen)


@numba.njit()
def _distal_n_m(state: NDArray[np.float64], effects: Any) -> float:
    """Return the torque at the jaw as its sensor sees it, with the sensor's hidden effects."""
    seen = state[places.DISTAL_TORQUE]
    row = effects.distal_drift
    if row[STRENGTH] != 0.0:
        seen += hidden_sensors.distal_drift_n_m(row, state[places.CLOCK])
    row = effects.distal_crosstalk
    if row[STRENGTH] != 0.0:
        seen += hidden_sensors.distal_crosstalk_n_m(row, state[places.CURRENT])
    return float(seen)


def spindle_count_of(angle_rad: float, sensors: SensorParameters) -> int:
    """Return the spindle encoder's count at an angle, closing positive."""
    return int(np.floor(-angle_rad / TURN_RAD * sensors.spindle_count_per_turn))


def columns_of(
    counts: NDArray[np.int32], setpoints: NDArray[np.int32], sensors: SensorParameters
) -> dict[str, NDArray[np.float64]]:
    """Return counts, shape (n, 8), and setpoints, shape (n, 2), as channels in SI units.

    They are closing positive, with the nominal scales; offsets and drift of the sensors stay in.
    """
    rows = counts.astype(np.float64)
    spindle_rad = TURN_RAD / sensors.spindle_count_per_turn
    return {
        "motor_angle_rad": rows[:, MOTOR] * TURN_RAD / sensors.motor_count_per_turn,
        "spindle_angle_rad": -rows[:, SPINDLE] * spindle_rad,
        "jaw_angle_rad": rows[:, JAW] * TURN_RAD / sensors.jaw_count_per_turn,
        "target_angle_rad": -setpoints[:, 0].astype(np.float64) * spindle_rad,
        "proximal_torque_n_m": rows[:, PROXIMAL] * sensors.torque_n_m_per_count,
        "distal_torque_n_m": -rows[:, DISTAL] * sensors.torque_n_m_per_count,
        "motor_current_a": rows[:, CURRENT] * sensors.current_a_per_count,
        "motor_command_ratio": -rows[:, COMMAND_E4] * 1e-4,
        "load_command_a": setpoints[:, 1].astype(np.float64) * 1e-3,
        "fsr_v": rows[:, FSR] * 3.3 / 4095.0,
    }
