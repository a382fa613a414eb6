"""Settling drift over a campaign: a sensor's zero that settles from run to run."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class CampaignDrift(Pointwise):
    """A zero that approaches its warm value by an exponential while a campaign lasts.

    Equation: error = a (1 - exp(-t / T)), t since the campaign's first run began.

    Source: Newton's law of cooling, for a strain gauge heated by its own bridge.
    """

    id = "sensor.drift.campaign"
    family = "sensor.drift"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1, "grasp": 1}
    roles: ClassVar = {"campaign_clock": "campaign_time_s"}
    amplitudes = (Parameter("drift", "target", "zero when warm less zero when cold"),)
    shape = (Parameter("time", "campaign_clock", "time until 63 % of it", 30, 2e4, points=6),)
    told_apart_by = "the unloaded sensor at rest before, during and after a campaign"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return the column."""
        return (-np.expm1(-np.maximum(inputs["campaign_clock"], 0.0) / shape[0]),)
