"""The physics of the simulated rig: three inertias, two springs, Coulomb friction, compiled.

Motor shaft, spindle and jaw, all closing-positive:

    Jm m'' = Kt i - bm m' - T / N - friction(Fm)                    motor shaft
    Js s'' = T - r C - bs s' - friction(Fs + mu |C|)                spindle
    Jq q'' = C - bq q' - kL iL - stop - friction(Fq + FL)           jaw and load motor
    T = kg (m / N - s) + cg (m' / N - s')                           twist of the gearhead
    C = kc (r s + q0 - q) + cc (r s' - q')                          cable, torque at the jaw

Both currents follow their commands with a first-order lag. Velocities are stepped first and
positions with the new velocities (semi-implicit Euler). Coulomb friction is solved, not smoothed:
in each step it takes the velocity the other torques would give towards zero by at most F dt / J, so
a body sticks exactly while the rest of the torques stay below F, and cannot chatter (time stepping
for dry friction; J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics",
1988). Nothing in the loop allocates and floating point is strict, so results repeat to the bit.
"""

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from rig.simulation import hidden_cable, hidden_drive, places
from rig.simulation.hidden import FIRST, STRENGTH
from rig.simulation.parameters import PlantParameters

TICK_S = 1e-3
"""One tick of the logger, s."""


def rest_state(parameters: PlantParameters, spindle_angle_rad: float) -> NDArray[np.float64]:
    """Return the state of a rig at rest with no torque anywhere, shape (`places.STATE_SIZE`,)."""
    state = np.zeros(places.STATE_SIZE)
    state[places.MOTOR_ANGLE] = parameters.gear_ratio * spindle_angle_rad
    state[places.SPINDLE_ANGLE] = spindle_angle_rad
    state[places.JAW_ANGLE] = parameters.cable_ratio * spindle_angle_rad + parameters.jaw_zero_rad
    state[places.AGE] = hidden_cable.OLD_S
    return state


@numba.njit()
def wrist_pitch_rad(p: Any, clock_s: float) -> float:
    """Return the pitch of the wrist, which swings by itself."""
    phase = 2.0 * math.pi * clock_s / p.wrist_period_s
    return float(p.wrist_middle_rad + p.wrist_swing_rad * math.sin(phase))


FULL = 6.0
"""Creep speeds at which friction is taken to be full: tanh is there to 1e-5."""


@numba.njit()
def clip(value: float, limit: float) -> float:
    """Return the value brought into plus and minus the limit."""
    return min(max(value, -limit), limit)


@numba.njit()
def braking(speed: float, most: float, creep_speed: float) -> float:
    """Return the speed that friction takes in a step, of the speed that other torques would give.

    It is all of it, but at most what full friction takes. With a creep speed, at which three
    quarters of the friction are there, the friction is its level times tanh(speed after the step /
    creep speed), solved by Newton steps, which come from below and settle.
    """
    if creep_speed <= 0.0:
        return clip(speed, most)
    if abs(speed) > most + FULL * creep_speed:
        return clip(speed, most)
    per_creep = 1.0 / creep_speed
    gain = most * per_creep
    after = speed / (1.0 + gain)
    for _ in range(3):
        share = math.tanh(after * per_creep)
        after -= (after + most * share - speed) / (1.0 + gain * (1.0 - share * share))
    return clip(speed - after, most)


@numba.njit()
def step_tick(
    state: NDArray[np.float64], p: Any, effects: Any, current_target_a: float, load_target_a: float
) -> None:
    """Move the plant by one tick under constant commands.

    The proximal sensor carries the drive unit: it measures the gear's output torque and the
    reaction to the rotor's acceleration. The distal sensor carries the load motor: it measures that
    motor's torque and its friction. Both are left in the state as of the last substep.

    This is one function so that its variables stay in registers: cut into functions of the state it
    takes more than twice as long. The state, shape (`places.STATE_SIZE`,), is changed in place; p
    is from `parameters.compiled`, the effects are a record of `hidden.table`.
    """
    steps = int(p.substeps_ratio)
    dt = TICK_S / steps
    target = clip(current_target_a, p.current_limit_a)
    current_gain = min(dt / p.current_lag_s, 1.0)
    load_gain = min(dt / p.load_lag_s, 1.0)
    dt_motor, dt_spindle = dt / p.rotor_inertia_kg_m2, dt / p.spindle_inertia_kg_m2
    dt_jaw = dt / p.jaw_inertia_kg_m2
    gear = 1.0 / p.gear_ratio
    jaw_friction = p.jaw_friction_n_m + p.load_friction_n_m
    load_share = p.load_friction_n_m / jaw_friction if jaw_friction > 0.0 else 0.0
    lag_gain = 1.0
    if effects.torque_lag[STRENGTH] != 0.0:
        row = effects.torque_lag
        lag_gain = min(2.0 * dt / (row[STRENGTH] * row[FIRST]), 1.0)
    if effects.jaw_mass[STRENGTH] != 0.0:
        dt_jaw = dt / (p.jaw_inertia_kg_m2 + effects.jaw_mass[STRENGTH] * 1.2e-4)

    motor, motor_speed = state[places.MOTOR_ANGLE], state[places.MOTOR_SPEED]
    spindle, spindle_speed = state[places.SPINDLE_ANGLE], state[places.SPINDLE_SPEED]
    jaw, jaw_speed = state[places.JAW_ANGLE], state[places.JAW_SPEED]
    current, load_current = state[places.CURRENT], state[places.LOAD_CURRENT]
    bristle, strain = state[places.BRISTLE], state[places.CREEP_STRAIN]
    bend, heat, rubbing = state[places.HYSTERESIS], state[places.HEAT], state[places.TWO_STATE]
    lag_first, lag_second = state[places.LAG_FIRST], state[places.LAG_SECOND]
    clock, age = state[places.CLOCK], state[places.AGE]
    wrist = wrist_pitch_rad(p, clock)
    wrist_speed = (wrist_pitch_rad(p, clock + TICK_S) - wrist) / TICK_S
    proximal, distal = state[places.PROXIMAL_TORQUE], state[places.DISTAL_TORQUE]

    for _ in range(steps):
        current += current_gain * (target - current)
        load_current += load_gain * (load_target_a - load_current)
        torque_current = current
        if effects.torque_lag[STRENGTH] != 0.0:
            lag_first += lag_gain * (current - lag_first)
            lag_second += lag_gain * (lag_first - lag_second)
            torque_current = lag_second
        motor_torque = p.torque_constant_n_m_a * torque_current
        if effects.winding_heat[STRENGTH] != 0.0:
            row = effects.winding_heat
            heat += dt * hidden_drive.winding_heat_rate(row, heat, current)
            motor_torque *= hidden_drive.winding_heat_ratio(row, heat)
        if effects.current_ripple[STRENGTH] != 0.0:
            motor_torque *= hidden_drive.current_ripple_ratio(effects.current_ripple, motor)
        if effects.torque_constant_sag[STRENGTH] != 0.0:
            row = effects.torque_constant_sag
            motor_torque *= hidden_drive.torque_constant_sag_ratio(row, current)
        if effects.motor_ripple[STRENGTH] != 0.0:
            motor_torque += hidden_drive.motor_ripple_n_m(effects.motor_ripple, motor)

        twist = gear * motor - spindle
        twist_rate = gear * motor_speed - spindle_speed
        spindle_per_twist = 1.0
        if effects.gear_eccentricity[STRENGTH] != 0.0:
            error, slope = hidden_drive.gear_eccentricity_rad(effects.gear_eccentricity, spindle)
            twist += error
            twist_rate += slope * spindle_speed
            spindle_per_twist -= slope
        stiffness = p.gear_stiffness_n_m_rad
        if effects.gear_backlash[STRENGTH] != 0.0:
            row = effects.gear_backlash
            twist_torque = hidden_drive.gear_backlash_n_m(row, twist, twist_rate, stiffness)
        else:
            twist_torque = stiffness * twist
        if effects.gear_stiffening[STRENGTH] != 0.0:
            twist_torque *= hidden_drive.gear_stiffening_ratio(effects.gear_stiffening, twist)
        twist_torque += p.gear_damping_n_m_s_rad * twist_rate

        stretch = p.cable_ratio * spindle + p.jaw_zero_rad - jaw
        stretch_rate = p.cable_ratio * spindle_speed - jaw_speed
        lever = p.cable_ratio
        if effects.eccentric_pulley[STRENGTH] != 0.0:
            wound, slope = hidden_cable.eccentric_pulley_rad(effects.eccentric_pulley, spindle)
            stretch += wound
            stretch_rate += slope * spindle_speed
            lever += slope
        if effects.wrist_pull[STRENGTH] != 0.0:
            wound, slope = hidden_cable.wrist_pull_rad(effects.wrist_pull, wrist)
            stretch += wound
            stretch_rate += slope * wrist_speed
        cable = p.cable_stiffness_n_m_rad * stretch + p.cable_damping_n_m_s_rad * stretch_rate
        if effects.cable_creep[STRENGTH] != 0.0:
            row, stiffness = effects.cable_creep, p.cable_stiffness_n_m_rad
            extra, rate = hidden_cable.cable_creep_n_m(row, strain, stiffness)
            cable += extra
            strain += dt * (stretch_rate - rate)
        if effects.cable_hysteresis[STRENGTH] != 0.0:
            row = effects.cable_hysteresis
            extra, rate = hidden_cable.cable_hysteresis_n_m(row, bend, stretch_rate)
            cable += extra
            bend += dt * rate

        motor_limit = p.motor_friction_n_m
        if effects.motor_friction:
            if effects.gear_two_state[STRENGTH] != 0.0:
                row = effects.gear_two_state
                rubbing = hidden_drive.gear_two_state(row, rubbing, motor_speed)
            motor_limit += hidden_drive.motor_friction_n_m(
                effects, motor_speed, spindle, rubbing, clock
            )
            motor_limit += gear * hidden_drive.gear_friction_n_m(effects, motor_speed, twist_torque)
        before = motor_speed
        viscous = p.motor_viscous_n_m_s_rad * motor_speed
        motor_speed += dt_motor * (motor_torque - viscous - gear * twist_torque)
        motor_speed -= braking(motor_speed, dt_motor * motor_limit, p.motor_creep_speed_rad_s)
        rotor_torque = (motor_speed - before) / dt_motor
        motor += dt * motor_speed

        spindle_limit = p.spindle_friction_n_m + p.cable_load_friction_ratio * abs(cable)
        viscous = p.spindle_viscous_n_m_s_rad * spindle_speed
        spindle_torque = spindle_per_twist * twist_torque - lever * cable - viscous
        if effects.spindle_friction:
            if effects.cable_dwell[STRENGTH] != 0.0:
                row = effects.cable_dwell
                age += dt * hidden_cable.cable_dwell_rate(row, age, spindle_speed)
            spindle_limit += hidden_cable.spindle_friction_n_m(
                effects, spindle, spindle_speed, cable, clock, age
            )
            spindle_limit += hidden_cable.wrist_friction_n_m(effects, spindle_speed, cable, wrist)
        if effects.spindle_ripple[STRENGTH] != 0.0:
            spindle_torque -= hidden_cable.spindle_ripple_n_m(effects.spindle_ripple, spindle)
        if effects.cable_presliding[STRENGTH] != 0.0:
            row = effects.cable_presliding
            extra, rate = hidden_cable.cable_presliding_n_m(row, bristle, spindle_speed)
            spindle_torque -= extra
            bristle += dt * rate
        spindle_speed += dt_spindle * spindle_torque
        most = dt_spindle * spindle_limit
        spindle_speed -= braking(spindle_speed, most, p.spindle_creep_speed_rad_s)
        proximal = spindle_per_twist * twist_torque + rotor_torque
        spindle += dt * spindle_speed

        load = p.load_torque_n_m_a * load_current
        jaw_torque = cable - p.jaw_viscous_n_m_s_rad * jaw_speed - load
        damping = p.stop_damping_n_m_s_rad * jaw_speed
        if jaw < p.stop_open_rad:
            jaw_torque += max(p.stop_stiffness_n_m_rad * (p.stop_open_rad - jaw) - damping, 0.0)
        elif jaw > p.stop_closed_rad:
            jaw_torque -= max(p.stop_stiffness_n_m_rad * (jaw - p.stop_closed_rad) + damping, 0.0)
        if effects.jaw_torque:
            jaw_torque -= hidden_cable.jaw_torque_n_m(effects, jaw)
        jaw_speed += dt_jaw * jaw_torque
        impulse = braking(jaw_speed, dt_jaw * jaw_friction, p.spindle_creep_speed_rad_s)
        jaw_speed -= impulse
        distal = load + load_share * impulse / dt_jaw
        jaw += dt * jaw_speed

    state[places.MOTOR_ANGLE], state[places.MOTOR_SPEED] = motor, motor_speed
    state[places.SPINDLE_ANGLE], state[places.SPINDLE_SPEED] = spindle, spindle_speed
    state[places.JAW_ANGLE], state[places.JAW_SPEED] = jaw, jaw_speed
    state[places.CURRENT], state[places.LOAD_CURRENT] = current, load_current
    state[places.BRISTLE], state[places.CREEP_STRAIN] = bristle, strain
    state[places.HYSTERESIS], state[places.HEAT], state[places.TWO_STATE] = bend, heat, rubbing
    state[places.LAG_FIRST], state[places.LAG_SECOND] = lag_first, lag_second
    state[places.CLOCK], state[places.AGE] = clock + TICK_S, age
    state[places.PROXIMAL_TORQUE], state[places.DISTAL_TORQUE] = proximal, distal
