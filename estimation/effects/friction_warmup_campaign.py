"""Warm-up friction over a campaign: friction that changes exponentially with time over all runs."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class CampaignWarmup(Pointwise):
    """Friction that decreases, or with a negative F grows, over hours of operation.

    Equation: torque = F exp(-t / time) tanh(speed / width), t from the start of the first run. F in
    N m, time in s, width in rad/s.

    Check: repeat the first run at the end of the campaign and after a night.

    Source: Bittencourt, Wernholt, Sander-Tavallaey and Brogardh 2010 (friction of a robot joint as
    it warms), to first order in temperature.
    """

    id = "friction.warmup.campaign"
    family = "friction.warmup"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "campaign_clock": "campaign_time_s"}
    amplitudes = (Parameter("friction", "target", "loss at the start minus the final loss"),)
    shape = (
        Parameter("time", "campaign_clock", "time after which 37 % remains", 30, 2e4, points=6),
        Parameter("width", "speed", "speed at which the tanh reaches 76 %", 1e-2, 50.0, points=6),
    )
    told_apart_by = "the first run repeated at the end, and again after a night"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        fade = np.exp(-np.maximum(inputs["campaign_clock"], 0.0) / shape[0])
        return (fade * np.tanh(inputs["speed"] / shape[1]),)
