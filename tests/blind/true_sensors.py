"""What a faulty sensor makes of a true channel, and what was true of a measured one."""

from collections.abc import Callable, Mapping
from typing import Any

import numba
import numpy as np

from estimation.recording import FloatArray
from rig.simulation import hidden_sensors
from rig.simulation.hidden import FIRST, STRENGTH
from tests.blind.true_forms import LEAD_S, TICK_S, Channels, clock_of, each, lagged

Sensed = Callable[[Channels, FloatArray, FloatArray], FloatArray]
"""Channels of a run, a row of `hidden.table`, a channel's values: those values changed, (n,)."""


def _bent(function: Any) -> Sensed:
    def sensed(c: Channels, row: FloatArray, values: FloatArray) -> FloatArray:
        grid = np.linspace(values.min(), values.max(), 4000)
        made: FloatArray = np.interp(values, grid, grid * each(function, row, grid))
        return made

    return sensed


def _straightened(function: Any) -> Sensed:
    def sensed(c: Channels, row: FloatArray, values: FloatArray) -> FloatArray:
        reach = 1.2 * float(np.abs(values).max())
        grid = np.linspace(-reach, reach, 4000)
        shown = np.maximum.accumulate(grid * each(function, row, grid))
        true: FloatArray = np.interp(values, shown, grid)
        return true

    return sensed


@numba.njit(cache=True)
def _crept(row: Any, values: Any, back: bool, lead: int) -> Any:
    out, places, creep = np.empty(len(values)), np.zeros(2), 0.0
    for i in range(-lead, len(values)):
        # the load came up before the run
        value = values[i] if i >= 0 else values[0] * (lead + i) / lead
        true = value - creep if back else value
        creep = hidden_sensors.proximal_creep_n_m(row, places, true, TICK_S)
        if i >= 0:
            out[i] = true if back else value + creep
    return out


LEAD = round(LEAD_S / TICK_S)


def _creeping(c: Channels, row: FloatArray, values: FloatArray) -> FloatArray:
    made: FloatArray = _crept(row, values, False, LEAD)
    return made


def _uncrept(c: Channels, row: FloatArray, values: FloatArray) -> FloatArray:
    true: FloatArray = _crept(row, values, True, LEAD)
    return true


def _late(c: Channels, row: FloatArray, values: FloatArray) -> FloatArray:
    half = 0.5 * abs(row[STRENGTH] * row[FIRST])
    made: FloatArray = lagged(lagged(values, half), half)
    return made


def _early(c: Channels, row: FloatArray, values: FloatArray) -> FloatArray:
    half = 0.5 * abs(row[STRENGTH] * row[FIRST])
    rate = np.gradient(values, TICK_S)
    true: FloatArray = values + 2.0 * half * rate + half * half * np.gradient(rate, TICK_S)
    return true


def _without_drift(c: Channels, row: FloatArray, values: FloatArray) -> FloatArray:
    return values - each(hidden_sensors.distal_drift_n_m, row, clock_of(c))


def _without_crosstalk(c: Channels, row: FloatArray, values: FloatArray) -> FloatArray:
    grid = np.linspace(c["motor_current_a"].min(), c["motor_current_a"].max(), 2000)
    heard = each(hidden_sensors.distal_crosstalk_n_m, row, grid)
    true: FloatArray = values - np.interp(c["motor_current_a"], grid, heard)
    return true


def _with_wave(c: Channels, row: FloatArray, values: FloatArray) -> FloatArray:
    angle = c["jaw_angle_rad"]
    grid = np.linspace(angle.min(), angle.max(), 4000)
    wave = each(hidden_sensors.jaw_encoder_wave_rad, row, grid)
    made: FloatArray = values + np.interp(angle, grid, wave)
    return made


def _delayed(c: Channels, row: FloatArray, values: FloatArray) -> FloatArray:
    at = np.arange(len(values), dtype=np.float64)
    made: FloatArray = np.interp(at - row[STRENGTH] * row[FIRST], at, values)
    return made


SHOWN: Mapping[tuple[str, str], Sensed] = {
    ("proximal_bend", "proximal_torque_n_m"): _bent(hidden_sensors.proximal_bend_ratio),
    ("proximal_creep", "proximal_torque_n_m"): _creeping,
    ("proximal_lag", "proximal_torque_n_m"): _late,
    ("jaw_encoder_wave", "jaw_angle_rad"): _with_wave,
    ("jaw_delay", "jaw_angle_rad"): _delayed,
}
"""Hidden effect and the target it spoils to what the sensor shows of a true course."""

UNDONE: Mapping[tuple[str, str], Sensed] = {
    ("proximal_bend", "proximal_torque_n_m"): _straightened(hidden_sensors.proximal_bend_ratio),
    ("proximal_creep", "proximal_torque_n_m"): _uncrept,
    ("proximal_lag", "proximal_torque_n_m"): _early,
    ("distal_drift", "distal_torque_n_m"): _without_drift,
    ("distal_crosstalk", "distal_torque_n_m"): _without_crosstalk,
    ("current_sensor_bend", "motor_current_a"): _straightened(
        hidden_sensors.current_sensor_bend_ratio
    ),
}
"""Hidden effect and the regressor it spoils to what was true of a measured course."""
