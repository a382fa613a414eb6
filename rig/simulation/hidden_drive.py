"""Hidden effects of motor and gear: compiled functions of one row of `hidden.table`."""

import math
from typing import Any

import numba

from rig.simulation.hidden import FIRST, SECOND, STRENGTH, Row

RIPPLE_N_M = 0.08e-3
"""Amplitude of the ripple of the motor's torque at strength 1."""


@numba.njit()
def motor_friction_n_m(
    effects: Any, speed_rad_s: float, spindle_angle_rad: float, state: float, clock_s: float
) -> float:
    """Return the hidden Coulomb friction at the motor shaft; the state is `gear_two_state`'s."""
    return float(
        gear_stribeck_n_m(effects.gear_stribeck, speed_rad_s)
        + motor_asymmetry_n_m(effects.motor_asymmetry, speed_rad_s)
        + motor_drag_n_m(effects.motor_drag, speed_rad_s)
        + effects.gear_two_state[STRENGTH] * 0.35e-3 * state
        + gear_angle_viscous_n_m(effects.gear_angle_viscous, speed_rad_s, spindle_angle_rad)
        + motor_viscous_asymmetry_n_m(effects.motor_viscous_asymmetry, speed_rad_s)
        + grease_warmup_n_m(effects.grease_warmup, clock_s)
        + effects.gear_wear[STRENGTH] * 0.3e-3
    )


@numba.njit()
def gear_friction_n_m(effects: Any, motor_speed_rad_s: float, twist_n_m: float) -> float:
    """Return the hidden friction that grows with the torque in the gear, at the spindle."""
    dry = gear_load_friction_n_m(effects.gear_load_friction, twist_n_m)
    return dry + gear_load_viscous_n_m(effects.gear_load_viscous, motor_speed_rad_s, twist_n_m)


@numba.njit()
def motor_ripple_n_m(row: Row, motor_angle_rad: float) -> float:
    """Ripple at the motor shaft: A sin(k q + p) (1 + 0.35 sin q), A = 0.08 mN m at strength 1."""
    carrier = math.sin(row[FIRST] * motor_angle_rad + row[SECOND])
    return row[STRENGTH] * RIPPLE_N_M * carrier * (1.0 + 0.35 * math.sin(motor_angle_rad))


@numba.njit()
def gear_load_friction_n_m(row: Row, twist_torque_n_m: float) -> float:
    """Extra Coulomb level at the spindle: 0.15 T |T| / (|T| + T0)."""
    load = abs(twist_torque_n_m)
    return row[STRENGTH] * 0.15 * load * load / (load + row[FIRST])


@numba.njit()
def gear_stribeck_n_m(row: Row, motor_speed_rad_s: float) -> float:
    """Extra Coulomb level at the motor: F / (1 + x + x^3), x = |w| / w0, F = 0.35 mN m."""
    x = abs(motor_speed_rad_s) / row[FIRST]
    return row[STRENGTH] * 0.35e-3 / (1.0 + x + x * x * x)


@numba.njit()
def gear_backlash_n_m(
    row: Row, twist_rad: float, twist_rate_rad_s: float, stiffness: float
) -> float:
    """Contact torque: k p (1 + c p'), p = |twist| - gap, never pulling, in place of k twist."""
    penetration = abs(twist_rad) - row[STRENGTH] * row[FIRST]
    if penetration <= 0.0:
        return 0.0
    rate = twist_rate_rad_s if twist_rad > 0.0 else -twist_rate_rad_s
    torque = max(stiffness * penetration * (1.0 + row[SECOND] * rate), 0.0)
    return torque if twist_rad > 0.0 else -torque


@numba.njit()
def gear_eccentricity_rad(row: Row, spindle_angle_rad: float) -> tuple[float, float]:
    """Position error of the gear, e (sin(n q + p) + 0.3 sin(2 n q)), e = 2 mrad, and its slope.

    The slope over the spindle's angle keeps it free of energy.
    """
    angle = row[FIRST] * spindle_angle_rad
    error = math.sin(angle + row[SECOND]) + 0.3 * math.sin(2.0 * angle)
    slope = math.cos(angle + row[SECOND]) + 0.6 * math.cos(2.0 * angle)
    return row[STRENGTH] * 2e-3 * error, row[STRENGTH] * 2e-3 * row[FIRST] * slope


@numba.njit()
def torque_constant_sag_ratio(row: Row, current_a: float) -> float:
    """Factor of the torque constant: 1 - 0.25 x / (1 + x), x = |i| / i0; never negative."""
    x = abs(current_a) / row[FIRST]
    return max(1.0 - row[STRENGTH] * 0.25 * x / (1.0 + x), 0.0)


@numba.njit()
def motor_asymmetry_n_m(row: Row, motor_speed_rad_s: float) -> float:
    """Extra Coulomb level on opening: F/2 (1 - w / sqrt(w^2 + w0^2)), F = 0.3 mN m."""
    w = motor_speed_rad_s
    return row[STRENGTH] * 0.15e-3 * (1.0 - w / math.sqrt(w * w + row[FIRST] * row[FIRST]))


@numba.njit()
def motor_drag_n_m(row: Row, motor_speed_rad_s: float) -> float:
    """Extra friction that rises faster than the speed: D x^3 / (1 + x), x = |w| / w0, D = 0.3 mN m.

    Between the square and the cube of the speed.
    """
    x = abs(motor_speed_rad_s) / row[FIRST]
    return row[STRENGTH] * 0.3e-3 * x * x * x / (1.0 + x)


@numba.njit()
def gear_two_state(row: Row, state: float, motor_speed_rad_s: float) -> float:
    """Return the state after this step: 1 above the speed w1, 0 below w1 / 4, else as it was."""
    speed = abs(motor_speed_rad_s)
    if speed > row[FIRST]:
        return 1.0
    return 0.0 if speed < 0.25 * row[FIRST] else state


@numba.njit()
def gear_angle_viscous_n_m(row: Row, motor_speed_rad_s: float, spindle_angle_rad: float) -> float:
    """Viscous friction beyond an angle: b |w| (1 + y / sqrt(1 + y^2)) / 2, y = (q - q0) / 0.05 rad.

    b = 12 uN m s/rad at strength 1.
    """
    y = (spindle_angle_rad - row[FIRST]) / 0.05
    return row[STRENGTH] * 6e-6 * abs(motor_speed_rad_s) * (1.0 + y / math.sqrt(1.0 + y * y))


@numba.njit()
def current_ripple_ratio(row: Row, motor_angle_rad: float) -> float:
    """Factor of the motor's torque: 1 + 0.12 sin(k q + p) (1 + 0.35 sin q)."""
    carrier = math.sin(row[FIRST] * motor_angle_rad + row[SECOND])
    return 1.0 + row[STRENGTH] * 0.12 * carrier * (1.0 + 0.35 * math.sin(motor_angle_rad))


@numba.njit()
def winding_heat_rate(row: Row, heat: float, current_a: float) -> float:
    """Rate of the winding's heat h: h' = ((i / 0.12 A)^2 - h) / T."""
    x = current_a / 0.12
    return (x * x - heat) / row[FIRST]


@numba.njit()
def winding_heat_ratio(row: Row, heat: float) -> float:
    """Factor of the torque constant: 1 / (1 + 0.2 h)."""
    return 1.0 / (1.0 + row[STRENGTH] * 0.2 * heat)


@numba.njit()
def gear_stiffening_ratio(row: Row, twist_rad: float) -> float:
    """Factor of the gear's stiffness: 1 + 0.8 x^2 / (1 + x), x = |twist| / x0."""
    x = abs(twist_rad) / row[FIRST]
    return 1.0 + row[STRENGTH] * 0.8 * x * x / (1.0 + x)


@numba.njit()
def motor_viscous_asymmetry_n_m(row: Row, motor_speed_rad_s: float) -> float:
    """Viscous friction on opening: b |w| (1 - w / sqrt(w^2 + w0^2)) / 2, b = 20 uN m s/rad."""
    w = motor_speed_rad_s
    side = 1.0 - w / math.sqrt(w * w + row[FIRST] * row[FIRST])
    return row[STRENGTH] * 10e-6 * abs(w) * side


@numba.njit()
def gear_load_viscous_n_m(row: Row, motor_speed_rad_s: float, twist_torque_n_m: float) -> float:
    """Extra friction at the spindle: c |T| |w| / sqrt(1 + (w / w0)^2), c = 6 ms/rad."""
    x = motor_speed_rad_s / row[FIRST]
    film = abs(motor_speed_rad_s) / math.sqrt(1.0 + x * x)
    return row[STRENGTH] * 6e-3 * abs(twist_torque_n_m) * film


@numba.njit()
def grease_warmup_n_m(row: Row, clock_s: float) -> float:
    """Extra Coulomb level at the motor: F / (1 + y^1.5), y = t / T, F = 0.5 mN m at strength 1."""
    y = clock_s / row[FIRST]
    return row[STRENGTH] * 0.5e-3 / (1.0 + y * math.sqrt(y))
