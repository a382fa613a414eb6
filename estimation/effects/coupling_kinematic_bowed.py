"""Curved kinematic coupling: motion by the angle of another joint, to second order."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from estimation.effects.effect import Parameter, Pointwise


class BowedCoupling(Pointwise):
    """A cable that passes another joint at a distance from its axis.

    Its path length is not linear in that joint's angle.

    Equation: angle = c other angle + d other angle^2, c in rad/rad, d in rad/rad^2: the path length
    to second order.

    Check: move the other joint alone over its whole range and plot this joint's angle.

    Source: the path lengths of cables over pulleys whose centres move, Zhao and Nelson 2016,
    equations 1 to 5, expanded about the straight pose.
    """

    id = "coupling.kinematic.bowed"
    family = "coupling.kinematic"
    balances: ClassVar = {"stretch": 1}
    roles: ClassVar = {"other_angle": "wrist_pitch_rad"}
    amplitudes = (
        Parameter("ratio", "target / other_angle", "angle per radian of the other joint"),
        Parameter("bow", "target / other_angle / other_angle", "angle per radian squared of it"),
    )
    told_apart_by = "the other joint moved alone"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        angle = inputs["other_angle"]
        return angle, angle * angle
