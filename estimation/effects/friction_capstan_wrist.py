"""Capstan friction at the wrist: what the bent wrist adds to the cable's wrap."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class WristCapstan(Pointwise):
    """Loss of a cable that a joint bends by its own angle.

    Equation: torque = c load (exp(friction |bend| tanh(speed / width)) - 1).

    Source: the capstan equation of Euler and Eytelwein, with the joint's angle as the wrap.
    """

    id = "friction.capstan.wrist"
    family = "friction.capstan"
    balances: ClassVar = {"cable": 1, "grasp": -1, "pitch": -1, "yaw": -1}
    roles: ClassVar = {
        "speed": "motor_velocity_rad_s",
        "load": "distal_torque_n_m",
        "other_angle": "wrist_pitch_rad",
    }
    amplitudes = (Parameter("carried", "target / load", "share of the load carried", lower=0.0),)
    shape = (
        Parameter("friction", "1 / other_angle", "coefficient of friction", 0.03, 1.0, points=4),
        Parameter(
            "width", "speed", "speed at which 76 % of the direction is there", 1e-2, 50.0, points=6
        ),
    )
    confused_with = ("friction.load", "friction.position")
    told_apart_by = "the same motion in several poses of the wrist"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or array for each amplitude."""
        wrap = shape[0] * np.abs(inputs["other_angle"])
        return (inputs["load"] * np.expm1(wrap * np.tanh(inputs["speed"] / shape[1])),)
