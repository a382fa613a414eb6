"""What each hidden effect does in a balance: the truth's own forms, on recorded channels.

The forms are those of the simulated plant, called over the samples of a run. What a sensor makes of
a channel is in `true_sensors`.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numba
import numpy as np
from scipy import signal

from estimation.recording import FloatArray
from rig.simulation import hidden, hidden_cable, hidden_drive, hidden_sensors
from rig.simulation.hidden import FIRST, NAMES, STRENGTH
from rig.simulation.parameters import PlantParameters

PLANT = PlantParameters()
GEAR, RATIO, STIFFNESS = PLANT.gear_ratio, PLANT.cable_ratio, PLANT.cable_stiffness_n_m_rad
K = GEAR * PLANT.torque_constant_n_m_a
TICK_S = 1e-3
LEAD_S = 0.5
"""A bench's clock at the first sample of a run that starts where it stands."""

Channels = Mapping[str, FloatArray]
Added = Callable[[Channels, FloatArray, float], FloatArray]
"""Channels of a run, a row of `hidden.table`, width of the friction's sign: what adds to the
balance's target, shape (n,)."""


@numba.njit(cache=True)
def _motor_levels(table: Any, speed: Any, angle: Any, torque: Any, clock: Any) -> Any:
    levels, rubbing = np.empty(len(speed)), 0.0
    for i in range(len(speed)):
        rubbing = hidden_drive.gear_two_state(table[hidden.GEAR_TWO_STATE], rubbing, speed[i])
        levels[i] = hidden_drive.motor_friction_n_m(
            table, speed[i], angle[i], torque[i], 1.0 / 35.0, rubbing, clock[i]
        )
    return levels


@numba.njit(cache=True)
def _spindle_levels(table: Any, angle: Any, speed: Any, torque: Any, clock: Any, wrist: Any) -> Any:
    levels, age = np.empty(len(speed)), hidden_cable.OLD_S
    row = table[hidden.CABLE_DWELL]
    slip = max(row[FIRST], 1e-3)
    for i in range(len(speed)):
        rate = abs(speed[i]) / slip  # exact for a speed that holds over the tick
        settled = 1.0 / max(rate, 1e-6)
        age = settled + (age - settled) * math.exp(-TICK_S / settled)
        levels[i] = hidden_cable.spindle_friction_n_m(
            table, angle[i], speed[i], torque[i], clock[i], age, wrist[i]
        )
    return levels


def _table(name: str, row: FloatArray) -> FloatArray:
    whole = np.zeros((len(NAMES), 3))
    whole[NAMES.index(name)] = row
    return whole


def clock_of(c: Channels) -> FloatArray:
    clock: FloatArray = c["time_s"] - c["time_s"][0] + LEAD_S
    return clock


def each(function: Any, row: FloatArray, values: FloatArray) -> FloatArray:
    return np.array([function(row, float(x)) for x in values])


def motor_friction(name: str) -> Added:
    """Return a loss of motor and gear, in the motor's balance."""

    def added(c: Channels, row: FloatArray, width: float) -> FloatArray:
        speed = c["motor_velocity_rad_s"]
        levels = _motor_levels(
            _table(name, row),
            speed,
            c["spindle_angle_rad"],
            c["proximal_torque_n_m"],
            clock_of(c),
        )
        loss: FloatArray = -GEAR * levels * np.tanh(speed / width)
        return loss

    return added


def spindle_friction(name: str) -> Added:
    """Return a loss of the cable, in the cable's balance."""

    def added(c: Channels, row: FloatArray, width: float) -> FloatArray:
        speed = c["spindle_velocity_rad_s"]
        wrist = c.get("wrist_pitch_rad", np.zeros_like(speed))
        torque = c["distal_torque_n_m"]
        levels = _spindle_levels(
            _table(name, row), c["spindle_angle_rad"], speed, torque, clock_of(c), wrist
        )
        loss: FloatArray = levels * np.tanh(speed / width)
        return loss

    return added


def jaw_torque(name: str, share: float) -> Added:
    """Return a torque between jaw and ground, by its share in the balance's target."""

    def added(c: Channels, row: FloatArray, width: float) -> FloatArray:
        def torque(r: FloatArray, angle: float) -> float:
            return float(hidden_cable.jaw_torque_n_m(_table(name, r), angle))

        grid = np.linspace(c["jaw_angle_rad"].min(), c["jaw_angle_rad"].max(), 2000)
        course: FloatArray = np.interp(c["jaw_angle_rad"], grid, each(torque, row, grid))
        return share * course

    return added


def along(function: Any, channel: str, factor: float = 1.0, by: str = "") -> Added:
    """Return a plant's function of one channel, times a factor and perhaps another channel."""

    def added(c: Channels, row: FloatArray, width: float) -> FloatArray:
        grid = np.linspace(c[channel].min(), c[channel].max(), 4000)
        course = factor * np.interp(c[channel], grid, each(function, row, grid))
        whole: FloatArray = course * c[by] if by else course
        return whole

    return added


def torque_constant(function: Any, channel: str) -> Added:
    """Return what a factor of the torque constant, a function of one channel, adds."""

    def lost(row: FloatArray, value: float) -> float:
        return float(function(row, value)) - 1.0

    return along(lost, channel, K, "motor_current_a")


@numba.njit(cache=True)
def _heat(row: Any, current: Any) -> Any:
    ratios, heat = np.empty(len(current)), 0.0
    for i in range(len(current)):
        heat += TICK_S * hidden_drive.winding_heat_rate(row, heat, current[i])
        ratios[i] = hidden_drive.winding_heat_ratio(row, heat)
    return ratios


def _winding_heat(c: Channels, row: FloatArray, width: float) -> FloatArray:
    # half a second under the first load went before
    current = c["motor_current_a"]
    before = np.full(round(LEAD_S / TICK_S), current[0])
    ratios = _heat(row, np.concatenate([before, current]))[len(before) :]
    lost: FloatArray = K * current * (ratios - 1.0)
    return lost


@numba.njit(cache=True)
def lagged(values: Any, time_s: float) -> Any:
    out, place = np.empty(len(values)), values[:1].copy()
    for i in range(len(values)):
        out[i] = hidden_sensors.lagged(place, values[i], time_s, TICK_S)
    return out


def _torque_lag(c: Channels, row: FloatArray, width: float) -> FloatArray:
    half = 0.5 * abs(row[STRENGTH] * row[FIRST])
    late: FloatArray = lagged(lagged(c["motor_current_a"], half), half)
    return K * (late - c["motor_current_a"])


def _eccentricity(c: Channels, row: FloatArray, width: float) -> FloatArray:
    # the sensor sees the torque through the lever that the wave makes
    angle = c["spindle_angle_rad"]
    grid = np.linspace(angle.min(), angle.max(), 4000)
    slope = np.interp(angle, grid, each(hidden_drive.gear_eccentricity_slope, row, grid))
    wave = np.interp(angle, grid, each(hidden_drive.gear_eccentricity_rad, row, grid))
    twist = c["proximal_torque_n_m"] / PLANT.gear_stiffness_n_m_rad
    made: FloatArray = twist * slope / (1.0 - slope) - wave
    return made


def _stiffening(c: Channels, row: FloatArray, width: float) -> FloatArray:
    torque = c["proximal_torque_n_m"]
    twist = np.linspace(0.0, 0.2, 4000)
    grown = twist * each(hidden_drive.gear_stiffening_ratio, row, twist)
    carried = PLANT.gear_stiffness_n_m_rad * np.maximum.accumulate(grown)
    less: FloatArray = np.sign(torque) * np.interp(np.abs(torque), carried, twist)
    return less - torque / PLANT.gear_stiffness_n_m_rad


@numba.njit(cache=True)
def _bristle(row: Any, speed: Any) -> Any:
    out, bend = np.empty(len(speed)), 0.0
    for i in range(len(speed)):
        for _ in range(4):
            bend += 0.25 * TICK_S * hidden_cable.cable_presliding_rate(row, bend, speed[i])
        out[i] = hidden_cable.cable_presliding_n_m(row, bend)
    return out


def _presliding(c: Channels, row: FloatArray, width: float) -> FloatArray:
    bent: FloatArray = _bristle(row, c["spindle_velocity_rad_s"])
    return bent


@numba.njit(cache=True)
def _creeping(row: Any, rate: Any, start: float) -> Any:
    # k e + branch = C, so the branch takes its share of the cable's torque
    share = 1.0 + 0.2 * row[STRENGTH]
    out, strain = np.empty(len(rate)), start / share
    for i in range(len(rate)):
        strain += TICK_S * (rate[i] - hidden_cable.cable_creep_rate(row, strain)) / share
        out[i] = hidden_cable.cable_creep_n_m(row, strain, 1.0)
    return out


def _creep(c: Channels, row: FloatArray, width: float) -> FloatArray:
    rate = c["distal_torque_rate_n_m_s"] / STIFFNESS
    start = float(c["distal_torque_n_m"][0]) / STIFFNESS
    left: FloatArray = _creeping(row, rate, start * math.exp(-LEAD_S / max(row[FIRST], 0.05)))
    return left


def _mass(c: Channels, row: FloatArray, width: float) -> FloatArray:
    """The jaw swings on the cable: m q'' = k (q0 - q) + c (q0' - q')."""
    mass = float(hidden_cable.jaw_mass_kg_m2(row)) + PLANT.jaw_inertia_kg_m2
    still = RATIO * c["spindle_angle_rad"] - c["distal_torque_n_m"] / STIFFNESS
    damping = PLANT.cable_damping_n_m_s_rad
    swing = signal.cont2discrete(([damping, STIFFNESS], [mass, damping, STIFFNESS]), TICK_S)
    behind: FloatArray = signal.lfilter(swing[0][0], swing[1], still - still[0]) + still[0]
    return RATIO * STIFFNESS * (still - behind)


_MOTOR = ("motor_asymmetry", "motor_drag", "gear_stribeck", "gear_load_friction", "gear_two_state")
_MOTOR += ("gear_angle_viscous", "motor_viscous_asymmetry", "gear_load_viscous", "grease_warmup")
_SPINDLE = ("cable_growing_friction", "friction_step", "cable_dwell", "cable_capstan")
_SPINDLE += ("wrist_capstan", "cable_stiff", "cable_position_friction", "cable_load_notch")
_SPINDLE += ("wrist_pinch",)
_JAW = ("jaw_spring", "end_stop_spring", "jaw_detent", "jaw_weight")

ADDED: Mapping[tuple[str, str], Added] = {
    **{(name, "motor"): motor_friction(name) for name in (*_MOTOR, "gear_wear")},
    **{(name, "cable"): spindle_friction(name) for name in _SPINDLE},
    **{(name, "cable"): jaw_torque(name, RATIO) for name in _JAW},
    **{(name, "stretch"): jaw_torque(name, -1.0 / STIFFNESS) for name in _JAW},
    ("motor_ripple", "motor"): along(hidden_drive.motor_ripple_n_m, "motor_angle_rad", GEAR),
    ("current_ripple", "motor"): torque_constant(
        hidden_drive.current_ripple_ratio, "motor_angle_rad"
    ),
    ("torque_constant_sag", "motor"): torque_constant(
        hidden_drive.torque_constant_sag_ratio, "motor_current_a"
    ),
    ("winding_heat", "motor"): _winding_heat,
    ("torque_lag", "motor"): _torque_lag,
    ("gear_stiffening", "gearbox"): _stiffening,
    ("gear_eccentricity", "gearbox"): _eccentricity,
    ("cable_presliding", "cable"): _presliding,
    ("cable_creep", "stretch"): _creep,
    ("spindle_ripple", "cable"): along(hidden_cable.spindle_ripple_n_m, "spindle_angle_rad"),
    ("eccentric_pulley", "cable"): along(
        hidden_cable.eccentric_pulley_slope, "spindle_angle_rad", by="distal_torque_n_m"
    ),
    ("eccentric_pulley", "stretch"): along(hidden_cable.eccentric_pulley_rad, "spindle_angle_rad"),
    ("jaw_mass", "cable"): _mass,
    ("wrist_pull", "stretch"): along(hidden_cable.wrist_pull_rad, "wrist_pitch_rad"),
}
"""Hidden effect and balance to what it adds to the balance's target.

Missing are backlash, the cable's hysteresis and the jaw's mass in its stretch: what drives them,
the shock of a reversal and the ringing of the jaw, is faster than the filtered channels tell.
"""
