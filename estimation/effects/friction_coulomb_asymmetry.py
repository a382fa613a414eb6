"""Coulomb asymmetry: another loss when closing than when opening."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class CoulombAsymmetry(Pointwise):
    """The part of Coulomb friction that does not change its sign with the motion.

    Equation: torque = F |tanh(speed / width)|.

    Source: Armstrong-Helouvry, Dupont and Canudas de Wit 1994.
    """

    id = "friction.coulomb_asymmetry"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s"}
    amplitudes = (
        Parameter("asymmetry", "target", "half the loss of closing less that of opening"),
    )
    shape = (
        Parameter("width", "speed", "speed at which 76 % of the direction is there", 1e-3, 1e2),
    )
    confused_with = ("sensor.offset", "gravity.payload")
    told_apart_by = "rest periods, and slow motion in both directions"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        return (np.abs(np.tanh(inputs["speed"] / shape[0])),)
