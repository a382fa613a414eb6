"""Thermal torque loss by temperature: a torque constant that falls with motor temperature."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from estimation.effects.effect import Parameter, Pointwise

REFERENCE_K = 298.15
"""Reference temperature of the torque constant in data sheets, K."""


class MeasuredThermalLoss(Pointwise):
    """The torque constant falls in proportion to the motor's measured temperature.

    Equation: loss = c current (temperature - 298.15 K), current in A, temperature in K, c in N m/(A
    K).

    Check: compare c with the temperature coefficient of the data sheet.

    Source: the reversible temperature coefficient of a magnet's remanence, IEC 60404-8-1.
    """

    id = "motor.thermal.measured"
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

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return the current times the warming."""
        return (inputs["current"] * (inputs["temperature"] - REFERENCE_K),)
