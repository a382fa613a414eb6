"""Kinematic coupling by a cable whose path over the other joint is not round."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from estimation.effects.effect import Parameter, Pointwise


class BowedCoupling(Pointwise):
    """A cable that runs past another joint's axis, off the pulleys' middle.

    Equation: angle = c other angle + d other angle^2: the length of its path to second order.

    Source: the path lengths of cables over pulleys whose centres move, Zhao and Nelson 2016,
    equations 1 to 5, expanded about the straight pose.
    """

    id = "coupling.kinematic.bowed"
    family = "coupling.kinematic"
    balances: ClassVar = {"stretch": 1}
    roles: ClassVar = {"other_angle": "wrist_pitch_rad"}
    amplitudes = (
        Parameter("ratio", "target / other_angle", "what one radian there moves"),
        Parameter("bow", "target / other_angle / other_angle", "what its square moves"),
    )
    confused_with = ("spring.position", "sensor.encoder_inl")
    told_apart_by = "the other joint moved alone"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        angle = inputs["other_angle"]
        return angle, angle * angle
