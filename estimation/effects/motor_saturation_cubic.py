"""Saturation to first order: torque that falls behind a large current by its cube."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from estimation.effects.effect import Parameter, Pointwise


class CubicSaturation(Pointwise):
    """The first term by which a saturating magnetic circuit loses torque.

    Equation: loss = c current^3.

    Source: the first odd term of any symmetric saturation curve.
    """

    id = "motor.saturation.cubic"
    family = "motor.saturation"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"current": "motor_current_a"}
    amplitudes = (
        Parameter(
            "loss", "target / current / current / current", "loss for one cubic unit", lower=0.0
        ),
    )
    told_apart_by = "stall at several currents of both signs"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return the column."""
        return (inputs["current"] ** 3,)
