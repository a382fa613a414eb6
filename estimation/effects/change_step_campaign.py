"""A change between runs: friction that is another from one run on."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class CampaignFrictionStep(Pointwise):
    """Something is worn, mended or exchanged in the course of a campaign.

    Equation: torque = F tanh(speed / width) from the campaign's time `since` on. A change of an
    offset is not among the forms, since the offset of a run is a nuisance.

    Source: Page 1955 (a change of a parameter at an unknown point).
    """

    id = "change.step.campaign"
    family = "change.step"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "campaign_clock": "campaign_time_s"}
    amplitudes = (Parameter("friction", "target", "loss after the change less that before"),)
    shape = (
        Parameter("since", "campaign_clock", "time of the change", 20.0, 2e4, points=20),
        Parameter(
            "width", "speed", "speed at which 76 % of the direction is there", 0.1, 10.0, points=2
        ),
    )
    confused_with = ("friction.warmup", "sensor.drift")
    told_apart_by = "the first run repeated at the end"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        after = np.where(inputs["campaign_clock"] >= shape[0], 1.0, 0.0)
        return (after * np.tanh(inputs["speed"] / shape[1]),)
