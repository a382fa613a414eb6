"""Hidden effects of the sensors: compiled functions of one row of `hidden.table`, once a tick."""

import math

import numba
import numpy as np
from numpy.typing import NDArray

from rig.simulation.hidden import FIRST, SECOND, STRENGTH, Row

RING = 64
"""Ticks of the jaw angle that the delayed encoder remembers."""


@numba.njit()
def bend_ratio(row: Row, value: float) -> float:
    """Factor of a measured current or torque: 1 + 0.2 x^2 / (1 + x^2), x = i / i0 or T / T0."""
    x = value / row[FIRST]
    return 1.0 + row[STRENGTH] * 0.2 * x * x / (1.0 + x * x)


@numba.njit()
def distal_drift_n_m(row: Row, clock_s: float) -> float:
    """Drift of the zero: D t / (t + T), D = 15 mN m; the clock starts with the bench."""
    return row[STRENGTH] * 15e-3 * clock_s / (clock_s + row[FIRST])


@numba.njit()
def distal_crosstalk_n_m(row: Row, current_a: float) -> float:
    """What the motor's current adds: 0.08 i / (1 + |i| / i0) N m/A."""
    return row[STRENGTH] * 0.08 * current_a / (1.0 + abs(current_a) / row[FIRST])


@numba.njit()
def lagged(place: NDArray[np.float64], value: float, time_s: float, tick_s: float) -> float:
    """Move a first-order lag by one tick, exactly for a held value, and return its output."""
    if time_s > 0.0:
        place[0] += (1.0 - math.exp(-tick_s / time_s)) * (value - place[0])
    else:
        place[0] = value
    return float(place[0])


@numba.njit()
def proximal_creep_n_m(
    row: Row, places: NDArray[np.float64], torque_n_m: float, tick_s: float
) -> float:
    """Creep of the sensor: 0.1 (0.6 s1 + 0.4 s2), s1 and s2 lag the torque by T and 4 T."""
    fast = lagged(places[:1], torque_n_m, row[FIRST], tick_s)
    slow = lagged(places[1:2], torque_n_m, 4.0 * row[FIRST], tick_s)
    return row[STRENGTH] * 0.1 * (0.6 * fast + 0.4 * slow)


@numba.njit()
def proximal_lag_n_m(
    row: Row, places: NDArray[np.float64], torque_n_m: float, tick_s: float
) -> float:
    """Torque behind two lags in a row of half the time each."""
    half = 0.5 * row[STRENGTH] * row[FIRST]
    return lagged(places[1:2], lagged(places[:1], torque_n_m, half, tick_s), half, tick_s)


@numba.njit()
def delayed(row: Row, ring: NDArray[np.float64], tick: int, value: float) -> float:
    """Return the value of some ticks ago, smeared over three ticks by weights 1, 2, 1.

    Before the ring, shape (`RING`,), is filled, it is the oldest value there is. The delay is at
    most `RING` - 4 ticks; the tick counts from the empty ring.
    """
    ring[tick % RING] = value
    ticks = min(row[STRENGTH] * row[FIRST], RING - 4.0)
    whole = int(ticks)
    part = ticks - whole
    total = 0.0
    for k in range(-1, 2):
        weight = 0.5 if k == 0 else 0.25
        near = min(max(whole + k, 0), tick)
        far = min(near + 1, tick)
        total += weight * ((1.0 - part) * ring[(tick - near) % RING])
        total += weight * part * ring[(tick - far) % RING]
    return total


@numba.njit()
def jaw_encoder_wave_rad(row: Row, jaw_angle_rad: float) -> float:
    """Error of the jaw encoder: e (sin(n q + p) + 0.3 sin(2 n q)), e = 5 mrad at strength 1."""
    angle = row[FIRST] * jaw_angle_rad
    return row[STRENGTH] * 5e-3 * (math.sin(angle + row[SECOND]) + 0.3 * math.sin(2.0 * angle))
