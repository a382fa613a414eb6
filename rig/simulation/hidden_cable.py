"""Hidden effects of cable, spindle and jaw: compiled functions of one row of `hidden.table`."""

import math
from typing import Any

import numba

from rig.simulation.hidden import FIRST, SECOND, STRENGTH, Row


@numba.njit()
def spindle_friction_n_m(
    effects: Any,
    angle_rad: float,
    speed_rad_s: float,
    cable_n_m: float,
    clock_s: float,
    age_s: float,
) -> float:
    """Return the hidden Coulomb friction at the spindle, given the torque that the cable carries.

    The clock starts with the bench; the age is that of the contact of `cable_dwell`.
    """
    capstan = effects.cable_capstan
    return float(
        cable_position_friction_n_m(effects.cable_position_friction, angle_rad)
        + cable_growing_friction_n_m(effects.cable_growing_friction, angle_rad)
        + cable_load_notch_n_m(effects.cable_load_notch, angle_rad, cable_n_m)
        + friction_step_n_m(effects.friction_step, clock_s)
        + effects.cable_stiff[STRENGTH] * 20e-3
        + cable_dwell_n_m(effects.cable_dwell, age_s)
        + wrapped_n_m(capstan[STRENGTH] * capstan[FIRST], cable_n_m, speed_rad_s)
    )


@numba.njit()
def wrist_friction_n_m(
    effects: Any, speed_rad_s: float, cable_n_m: float, wrist_rad: float
) -> float:
    """Return the hidden Coulomb friction at the spindle that depends on the wrist's pitch."""
    row = effects.wrist_capstan
    wrap = row[STRENGTH] * row[FIRST] * abs(wrist_rad)
    pinch = wrist_pinch_n_m(effects.wrist_pinch, wrist_rad)
    return wrapped_n_m(wrap, cable_n_m, speed_rad_s) + pinch


@numba.njit()
def jaw_torque_n_m(effects: Any, jaw_angle_rad: float) -> float:
    """Return the hidden torque that opposes closing at the jaw."""
    return (
        jaw_spring_n_m(effects.jaw_spring, jaw_angle_rad)
        + end_stop_spring_n_m(effects.end_stop_spring, jaw_angle_rad)
        + jaw_detent_n_m(effects.jaw_detent, jaw_angle_rad)
        + jaw_weight_n_m(effects.jaw_weight, jaw_angle_rad)
    )


@numba.njit()
def cable_position_friction_n_m(row: Row, spindle_angle_rad: float) -> float:
    """Extra Coulomb level at the spindle: F / (1 + x^2)^2, x = (q - q0) / width, F = 15 mN m."""
    x = (spindle_angle_rad - row[FIRST]) / row[SECOND]
    bump = 1.0 / (1.0 + x * x)
    return row[STRENGTH] * 15e-3 * bump * bump


@numba.njit()
def cable_presliding_n_m(row: Row, bristle: float, spindle_speed: float) -> tuple[float, float]:
    """Torque of a deflected bristle on the spindle: F u, F = 12 mN m at strength 1.

    Also the rate of its bend u in -1..1: u' = w / z0 (1 - u^3 sgn w).
    """
    bend = bristle * bristle * bristle
    rate = spindle_speed / row[FIRST] * (1.0 - (bend if spindle_speed > 0.0 else -bend))
    return row[STRENGTH] * 12e-3 * bristle, rate


@numba.njit()
def cable_creep_n_m(row: Row, strain_rad: float, stiffness: float) -> tuple[float, float]:
    """Tension of the branch that relaxes: 0.2 k e, e the strain not yet relaxed.

    Also the rate of relaxation: e (1 + |e| / 0.1 rad) / T.
    """
    rate = strain_rad * (1.0 + abs(strain_rad) / 0.1) / row[FIRST]
    return row[STRENGTH] * 0.2 * stiffness * strain_rad, rate


@numba.njit()
def jaw_spring_n_m(row: Row, jaw_angle_rad: float) -> float:
    """Torque that opposes closing: k x / (1 + |x| / x0), x = q - rest, k = 0.04 N m/rad."""
    x = jaw_angle_rad - row[FIRST]
    return row[STRENGTH] * 0.04 * x / (1.0 + abs(x) / row[SECOND])


@numba.njit()
def end_stop_spring_n_m(row: Row, jaw_angle_rad: float) -> float:
    """Torque that opposes closing: k p^1.5, p = q - contact, k = 0.15 N m at strength 1."""
    penetration = jaw_angle_rad - row[FIRST]
    if penetration <= 0.0:
        return 0.0
    return row[STRENGTH] * 0.15 * penetration * math.sqrt(penetration)


@numba.njit()
def cable_growing_friction_n_m(row: Row, spindle_angle_rad: float) -> float:
    """Extra Coulomb level at the spindle: F y^2 / (1 + y), y = (q - q0) / width, F = 12 mN m."""
    y = max(spindle_angle_rad - row[FIRST], 0.0) / row[SECOND]
    return row[STRENGTH] * 12e-3 * y * y / (1.0 + y)


@numba.njit()
def cable_load_notch_n_m(row: Row, spindle_angle_rad: float, cable_torque_n_m: float) -> float:
    """Extra Coulomb level where the cable is worn: 0.4 |C| / (1 + x^2)^2, x = (q - q0) / width."""
    x = (spindle_angle_rad - row[FIRST]) / row[SECOND]
    bump = 1.0 / (1.0 + x * x)
    return row[STRENGTH] * 0.4 * abs(cable_torque_n_m) * bump * bump


@numba.njit()
def friction_step_n_m(row: Row, clock_s: float) -> float:
    """Extra Coulomb level at the spindle from a time on: F x / (1 + x), x = (t - t0) / 0.1 s.

    F = 12 mN m at strength 1; the clock starts with the bench.
    """
    x = max(clock_s - row[FIRST], 0.0) / 0.1
    return row[STRENGTH] * 12e-3 * x / (1.0 + x)


@numba.njit()
def cable_hysteresis_n_m(row: Row, bend: float, stretch_rate_rad_s: float) -> tuple[float, float]:
    """Tension of the wires that rub on each other: F u, F = 10 mN m at strength 1.

    Also the rate of the bend u: u' = e' / z0 (1 - u^2 (0.7 sgn(e' u) + 0.3)), Bouc-Wen of order 2.
    """
    sign = 1.0 if stretch_rate_rad_s * bend > 0.0 else -1.0
    rate = stretch_rate_rad_s / row[FIRST] * (1.0 - bend * bend * (0.7 * sign + 0.3))
    return row[STRENGTH] * 10e-3 * bend, rate


@numba.njit()
def spindle_ripple_n_m(row: Row, spindle_angle_rad: float) -> float:
    """Torque that opposes closing: A (sin(k q + p) + 0.3 sin(2 k q)), A = 7 mN m."""
    angle = row[FIRST] * spindle_angle_rad
    return row[STRENGTH] * 7e-3 * (math.sin(angle + row[SECOND]) + 0.3 * math.sin(2.0 * angle))


@numba.njit()
def eccentric_pulley_rad(row: Row, spindle_angle_rad: float) -> tuple[float, float]:
    """Cable wound beyond the round pulley's, 0.12 / n (sin(n q + p) + 0.15 sin(2 n q)); its slope.

    The slope over the spindle's angle is the lever arm that it adds.
    """
    angle = row[FIRST] * spindle_angle_rad
    wave = math.sin(angle + row[SECOND]) + 0.15 * math.sin(2.0 * angle)
    slope = row[STRENGTH] * 0.12 * (math.cos(angle + row[SECOND]) + 0.3 * math.cos(2.0 * angle))
    return row[STRENGTH] * 0.12 / row[FIRST] * wave, slope


@numba.njit()
def jaw_detent_n_m(row: Row, jaw_angle_rad: float) -> float:
    """A notch the jaw falls into: A 3 x / (1 + x^2)^2, x = (q - q0) / width, A = 8 mN m."""
    x = (jaw_angle_rad - row[FIRST]) / row[SECOND]
    bump = 1.0 / (1.0 + x * x)
    return row[STRENGTH] * 24e-3 * x * bump * bump


OLD_S = 10.0
"""Age at which a contact's friction is at the stated level; a bench starts so rested."""

YOUNG_S = 0.05


@numba.njit()
def cable_dwell_rate(row: Row, age_s: float, spindle_speed: float) -> float:
    """Rate of the contact's age: 1 - |w| age / slip, the ageing law of Dieterich and Ruina."""
    return 1.0 - abs(spindle_speed) * age_s / row[FIRST]


@numba.njit()
def cable_dwell_n_m(row: Row, age_s: float) -> float:
    """Extra Coulomb level at the spindle: F ln(1 + age / young) / ln(1 + old / young), F = 40 mN m.

    Logarithmic in the time of rest.
    """
    full = math.log(1.0 + OLD_S / YOUNG_S)
    return row[STRENGTH] * 40e-3 * math.log(1.0 + max(age_s, 0.0) / YOUNG_S) / full


@numba.njit()
def wrapped_n_m(wrap: float, cable_torque_n_m: float, spindle_speed: float) -> float:
    """Loss of a wrapped cable: |C| 2 x / (2 - x) on closing, |C| 2 x / (2 + x) on opening.

    x is friction times angle of wrap. In between the change is as smooth as the speed's sign.
    """
    side = spindle_speed / math.sqrt(spindle_speed * spindle_speed + 0.05 * 0.05)
    return 2.0 * wrap / (2.0 - min(wrap, 1.5) * side) * abs(cable_torque_n_m)


@numba.njit()
def wrist_pull_rad(row: Row, wrist_angle: float) -> tuple[float, float]:
    """Cable that the wrist winds, c (sin p + b (1 - cos p)), c = 0.025; its slope."""
    bow = row[FIRST] * (1.0 - math.cos(wrist_angle))
    slope = row[STRENGTH] * 0.025 * (math.cos(wrist_angle) + row[FIRST] * math.sin(wrist_angle))
    return row[STRENGTH] * 0.025 * (math.sin(wrist_angle) + bow), slope


@numba.njit()
def wrist_pinch_n_m(row: Row, wrist_angle: float) -> float:
    """Extra Coulomb level at one pitch: F / (1 + x^2)^2, x = (p - p0) / width, F = 25 mN m."""
    x = (wrist_angle - row[FIRST]) / row[SECOND]
    bump = 1.0 / (1.0 + x * x)
    return row[STRENGTH] * 25e-3 * bump * bump


@numba.njit()
def jaw_weight_n_m(row: Row, jaw_angle_rad: float) -> float:
    """Torque that opposes closing: A cos x (1 + 0.15 sin x), x = q - q0, A = 40 mN m."""
    x = jaw_angle_rad - row[FIRST]
    return row[STRENGTH] * 40e-3 * math.cos(x) * (1.0 + 0.15 * math.sin(x))
