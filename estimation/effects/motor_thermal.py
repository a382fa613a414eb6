"""Thermal torque loss: a torque constant that falls with the heat of the current."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import (
    REFERENCE_K,
    Inputs,
    Parameter,
    Pointwise,
    Remembering,
    Row,
    Shape,
)
from estimation.effects.memory import BEGINNING, age, not_settled
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), the last time, the last current, the heat."""
    for i in range(len(now)):
        time, current = now[i, 0], now[i, 1]
        past = time - state[1] if state[0] else 0.0
        if past > 0.0:
            power = 0.5 * (state[2] * state[2] + current * current)
            state[3] = power + (state[3] - power) * np.exp(-past / shape[0])
        state[0], state[1], state[2] = 1.0, time, current
        rows[i, 0] = current * state[3]


class ThermalLoss(Remembering):
    """The torque constant falls as the heat of the windings reaches the magnets.

    Equation: loss = c current heat; d heat / dt = (current^2 - heat) / T, heat = 0 at the start.
    current in A, heat in A^2, T in s, c in N m/A^3.

    Check: measure the motor's temperature, and repeat a run at once and after the motor has cooled.

    Source: the one-body thermal model of a motor, IEC 60034-11, and a magnet's remanence that falls
    in proportion to its temperature.
    """

    id = "motor.thermal"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"clock": "time_s", "current": "motor_current_a"}
    amplitudes = (
        Parameter(
            "loss",
            "target / current / current / current",
            "fall of the torque constant per unit of heat",
            lower=0.0,
        ),
    )
    shape = (Parameter("time_constant", "clock", "thermal time constant", 0.3, 300.0, points=8),)
    walk = _walk
    rest: ClassVar[tuple[float, ...]] = (0.0, 0.0, 0.0, 0.0)
    told_apart_by = "a run repeated immediately, and again after the motor has cooled"


class CampaignWarming(Pointwise):
    """The torque constant settles to its warm value while a rig works for minutes or hours.

    Equation: loss = c current (1 - exp(-t / T)), t since the campaign's first run began.

    Source: Newton's law of cooling under a steady mean load, and a magnet's remanence that falls in
    proportion to its temperature.
    """

    id = "motor.thermal.campaign"
    meaning = "a torque constant that settles over the minutes or hours of a campaign"
    family = "motor.thermal"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"campaign_clock": "campaign_time_s", "current": "motor_current_a"}
    amplitudes = (
        Parameter("loss", "target / current", "fall of the torque constant, warm", lower=0.0),
    )
    shape = (Parameter("time", "campaign_clock", "thermal time constant", 30, 2e4, points=6),)
    told_apart_by = "the first run once more at the end, and once more after the motor has cooled"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["current"] * (1.0 - not_settled(inputs, shape[0])),)


class MeasuredThermalLoss(Pointwise):
    """The torque constant falls in proportion to the motor's measured temperature.

    Equation: loss = c current (temperature - 298.15 K), current in A, temperature in K, c in N m/(A
    K).

    Check: compare c with the temperature coefficient of the data sheet.

    Source: the reversible temperature coefficient of a magnet's remanence, IEC 60404-8-1.
    """

    id = "motor.thermal.measured"
    meaning = "a torque constant that falls with a measured temperature"
    family = "motor.thermal"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"current": "motor_current_a", "temperature": "motor_temperature_k"}
    amplitudes = (
        Parameter(
            "loss",
            "target / current / temperature",
            "fall of the torque constant per kelvin",
            lower=0.0,
        ),
    )
    told_apart_by = "a run repeated immediately, and again after the motor has cooled"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["current"] * (inputs["temperature"] - REFERENCE_K),)


@numba.njit(cache=True)
def _walk_warming(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    for i in range(len(now)):
        rows[i, 0] = now[i, 1] * (1.0 - np.exp(-age(now[i, 0], state) / shape[0]))


class WarmingLoss(ThermalLoss):
    """The torque constant settles to its warm value, whatever the source of heat.

    Equation: loss = c current (1 - exp(-t / T)), t from the first sample of the run. current in A,
    c in N m/A, T in s.

    Check: repeat a run at once and after the motor has cooled.

    Source: Newton's law of cooling under a steady mean load, and a magnet's remanence that falls in
    proportion to its temperature.
    """

    id = "motor.thermal.warming"
    meaning = "a torque constant that settles over a run"
    amplitudes = (
        Parameter("loss", "target / current", "fall of the torque constant, warm", lower=0.0),
    )
    shape = (Parameter("time_constant", "clock", "thermal time constant", 0.5, 100.0, points=6),)
    walk = _walk_warming
    rest = BEGINNING
