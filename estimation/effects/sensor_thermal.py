"""Temperature of a sensor: a zero or a gain that follows a measured temperature."""

from typing import ClassVar

from estimation.effects.effect import REFERENCE_K, Inputs, Parameter, Pointwise, Row, Shape


class ThermalZero(Pointwise):
    """A zero that follows a measured temperature.

    Equation: error = a (temperature - 298.15 K). a in the target's unit per K, temperature in K.

    Check: read the unloaded sensor when it is cold and when it is warm.

    Source: the temperature effect on the minimum dead load output of a load cell, OIML R 60 (2017).
    """

    id = "sensor.thermal"
    meaning = "a zero that follows a measured temperature"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1, "grasp": 1}
    roles: ClassVar = {"temperature": "motor_temperature_k"}
    amplitudes = (Parameter("rate", "target / temperature", "change of the zero per kelvin"),)
    told_apart_by = "the unloaded sensor when it is cold and when it is warm"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["temperature"] - REFERENCE_K,)


class ThermalGain(Pointwise):
    """A gain that follows a measured temperature.

    Equation: error = a reading (temperature - 298.15 K). a in 1/K, temperature in K.

    Check: load the sensor with one reference weight when it is cold and when it is warm.

    Source: the temperature effect on the sensitivity of a load cell, OIML R 60 (2017).
    """

    id = "sensor.thermal.gain"
    meaning = "a gain that follows a measured temperature"
    family = "sensor.thermal"
    balances: ClassVar = ThermalZero.balances
    roles: ClassVar = {"reading": "motor_load_n_m", "temperature": "motor_temperature_k"}
    amplitudes = (
        Parameter("rate", "target / reading / temperature", "change of the gain per kelvin"),
    )
    told_apart_by = "one reference weight when the sensor is cold and when it is warm"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["reading"] * (inputs["temperature"] - REFERENCE_K),)
