"""Temperature of a transmission: a compliance that changes with it, measured or over time."""

from typing import ClassVar

from estimation.effects.effect import REFERENCE_K, Inputs, Parameter, Pointwise, Row, Shape
from estimation.effects.memory import not_settled


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


class CampaignCompliance(ThermalCompliance):
    """A compliance that settles to its warm or seated value while a rig works for minutes or hours.

    Equation: deflection = a load exp(-t / time), t from the start of the first run. a in the
    target's unit per unit of the load, time in s.

    Check: repeat the first run at the end of the campaign and after a night.

    Source: Ferry 1980 (moduli of polymers over temperature), to first order, with Newton's law of
    cooling.
    """

    id = "transmission.thermal.campaign"
    meaning = "a compliance that changes over the minutes or hours of a campaign"
    roles: ClassVar = {"load": "proximal_torque_n_m", "campaign_clock": "campaign_time_s"}
    amplitudes = (
        Parameter("compliance", "target / load", "compliance at the start less the final one"),
    )
    shape = (
        Parameter("time", "campaign_clock", "time after which 37 % remains", 30, 2e4, points=6),
    )
    told_apart_by = "the first run repeated at the end, and again after a night"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (inputs["load"] * not_settled(inputs, shape[0]),)
