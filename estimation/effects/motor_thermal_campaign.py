"""Thermal loss of torque over a campaign: a motor that warms from run to run."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class CampaignWarming(Pointwise):
    """The torque constant settles to its warm value while a rig works for minutes or hours.

    Equation: loss = c current (1 - exp(-t / T)), t since the campaign's first run began.

    Source: Newton's law of cooling under a steady mean load, and a magnet's remanence that falls in
    proportion to its temperature.
    """

    id = "motor.thermal.campaign"
    family = "motor.thermal"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"campaign_clock": "campaign_time_s", "current": "motor_current_a"}
    amplitudes = (
        Parameter("loss", "target / current", "fall of the torque constant, warm", lower=0.0),
    )
    shape = (Parameter("time", "campaign_clock", "thermal time constant", 30, 2e4, points=6),)
    told_apart_by = "the first run once more at the end, and once more after the motor has cooled"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return the column."""
        return (-inputs["current"] * np.expm1(-np.maximum(inputs["campaign_clock"], 0) / shape[0]),)
