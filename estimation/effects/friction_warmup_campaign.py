"""Warm-up over a campaign: friction that settles from run to run."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class CampaignWarmup(Pointwise):
    """Friction that fades, or where it is negative grows, while a rig works for hours.

    Equation: torque = F exp(-t / time) tanh(speed / width), t since the first run began.

    Source: Bittencourt, Wernholt, Sander-Tavallaey and Brogardh 2010 (friction of a robot joint
    as it warms), to first order in temperature.
    """

    id = "friction.warmup.campaign"
    family = "friction.warmup"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "campaign_clock": "campaign_time_s"}
    amplitudes = (Parameter("friction", "target", "loss at the start beyond that of long after"),)
    shape = (
        Parameter("time", "campaign_clock", "time after which 37 % is left", 30, 2e4, points=6),
        Parameter(
            "width", "speed", "speed at which 76 % of the direction is there", 1e-2, 50.0, points=6
        ),
    )
    confused_with = ("change.step", "sensor.drift", "motor.thermal")
    told_apart_by = "the first run once more at the end, and once more after a night's rest"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        fade = np.exp(-np.maximum(inputs["campaign_clock"], 0.0) / shape[0])
        return (fade * np.tanh(inputs["speed"] / shape[1]),)
