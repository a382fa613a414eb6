"""The published estimate of EMPS, made again: inverse dynamic model and least squares.

A. Janot, M. Gautier, M. Brunot, "Data set and reference models of EMPS", Workshop on Nonlinear
System Identification Benchmarks, 2019. The position passes a Butterworth filter of order 4 at
100 Hz, forwards and backwards; speed and acceleration are central differences; the first 49 samples
are left out; all columns are decimated by ten.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from estimation.recording import FloatArray, Recording

RATE_HZ = 1000.0
"""The authors take the nominal rate; the clock recorded runs slow by 16 parts in a million."""

CUTOFF_HZ, ORDER, BORDER, EVERY = 100.0, 4, 49, 10


@dataclass(frozen=True)
class Published:
    """A published model fitted again."""

    parameters: dict[str, float]  # name with unit to value
    percent: float  # norm of the residual over that of the force, %


def standard(recording: Recording) -> Published:
    """Fit mass, viscous and Coulomb friction and an offset on one whole recording."""
    speed, acceleration, force = _motion(recording)
    columns = {
        "mass_kg": acceleration,
        "viscous_n_s_m": speed,
        "coulomb_n": np.sign(speed),
        "offset_n": np.ones_like(speed),
    }
    return _fitted(columns, force)


def by_direction(recording: Recording) -> Published:
    """Fit mass, and viscous and Coulomb friction of each direction."""
    speed, acceleration, force = _motion(recording)
    ahead, back = 0.5 * (1.0 + np.sign(speed)), 0.5 * (1.0 - np.sign(speed))
    columns = {
        "mass_kg": acceleration,
        "viscous_ahead_n_s_m": speed * ahead,
        "coulomb_ahead_n": np.sign(speed) * ahead,
        "viscous_back_n_s_m": speed * back,
        "coulomb_back_n": np.sign(speed) * back,
    }
    return _fitted(columns, force)


def _motion(recording: Recording) -> tuple[FloatArray, FloatArray, FloatArray]:
    filters = signal.butter(ORDER, CUTOFF_HZ / (RATE_HZ / 2))
    position = _both_ways(filters, recording["carriage_position_m"])
    speed = np.gradient(position, 1.0 / RATE_HZ)
    acceleration = np.gradient(speed, 1.0 / RATE_HZ)
    return speed[BORDER:], acceleration[BORDER:], recording["drive_force_n"][BORDER:]


def _fitted(columns: dict[str, FloatArray], force: FloatArray) -> Published:
    target = _decimated(force)
    table = np.column_stack([_decimated(column) for column in columns.values()])
    weights = np.linalg.lstsq(table, target, rcond=None)[0]
    residual = target - table @ weights
    percent = 100.0 * float(np.linalg.norm(residual) / np.linalg.norm(target))
    return Published(dict(zip(columns, map(float, weights), strict=True)), percent)


def _decimated(values: FloatArray) -> FloatArray:
    """Return every tenth value behind a Chebyshev filter of order 8, the last one kept."""
    filters = signal.cheby1(8, 0.05, 0.8 / EVERY)
    smooth = _both_ways(filters, values)
    return smooth[(len(values) - 1) % EVERY :: EVERY]


def _both_ways(filters: tuple[NDArray[np.float64], ...], values: FloatArray) -> FloatArray:
    numerator, denominator = filters
    length = 3 * (max(len(numerator), len(denominator)) - 1)
    return np.asarray(signal.filtfilt(numerator, denominator, values, padlen=length))
