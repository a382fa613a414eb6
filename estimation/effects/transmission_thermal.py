"""Temperature of a transmission: a compliance that follows a measured temperature."""

from typing import ClassVar

from estimation.effects.effect import REFERENCE_K, Inputs, Parameter, Pointwise, Row, Shape


class ThermalCompliance(Pointwise):
    """A compliance that follows a measured temperature, as that of a polymer does.

    Equation: deflection = a load (temperature - 298.15 K). a in the target's unit per unit of the
    load and K, temperature in K.

    Check: load the transmission alike when it is cold and when it is warm, and compare the bends.

    Source: Ferry 1980 (moduli of polymers over temperature), to first order.
    """

    id = "transmission.thermal"
    meaning = "a compliance that follows a measured temperature"
    balances: ClassVar = {"gearbox": 1, "stretch": -1}
    roles: ClassVar = {"load": "proximal_torque_n_m", "temperature": "motor_temperature_k"}
    amplitudes = (
        Parameter("rate", "target / load / temperature", "change of the compliance per kelvin"),
    )
    told_apart_by = "the same load when the transmission is cold and when it is warm"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["load"] * (inputs["temperature"] - REFERENCE_K),)
