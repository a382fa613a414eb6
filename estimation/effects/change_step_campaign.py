"""Friction change between runs: Coulomb friction that changes at one time of a campaign."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class CampaignFrictionStep(Pointwise):
    """A part that is worn, repaired or exchanged in the course of a campaign.

    Equation: torque = F tanh(speed / width) for t >= since, t from the campaign's start. F in N m,
    width in rad/s, since in s. A change of an offset is excluded, since each run has an offset of
    its own.

    Check: compare the maintenance notes with the time of the change, and repeat the first run.

    Source: Page 1955 (a change of a parameter at an unknown point).
    """

    id = "change.step.campaign"
    family = "change.step"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "campaign_clock": "campaign_time_s"}
    amplitudes = (Parameter("friction", "target", "loss after the change minus before"),)
    shape = (
        Parameter("since", "campaign_clock", "time of the change", 20.0, 2e4, points=20),
        Parameter("width", "speed", "speed at which the tanh reaches 76 %", 0.1, 10.0, points=2),
    )
    told_apart_by = "the first run repeated at the end"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        after = np.where(inputs["campaign_clock"] >= shape[0], 1.0, 0.0)
        return (after * np.tanh(inputs["speed"] / shape[1]),)
