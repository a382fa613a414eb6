"""Viscous asymmetry: another slope of the loss when closing."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class ViscousAsymmetry(Pointwise):
    """The part of viscous friction that does not change its sign with the motion.

    Equation: torque = b |speed|.

    Source: Armstrong-Helouvry, Dupont and Canudas de Wit 1994.
    """

    id = "friction.viscous_asymmetry"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s"}
    amplitudes = (
        Parameter(
            "asymmetry", "target / speed", "half the damping of closing less that of opening"
        ),
    )
    confused_with = ("friction.coulomb_asymmetry", "friction.drag")
    bends = ("speed",)
    told_apart_by = "a staircase of constant speeds in both directions"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        return (np.abs(inputs["speed"]),)
