"""Capstan friction at the wrist: capstan friction that grows with the wrist's bend angle."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from estimation.effects.effect import Parameter, Pointwise


class WristCapstan(Pointwise):
    """Friction of a cable that is wrapped over a joint by that joint's own angle.

    Equation: torque = c load (exp(friction |bend| tanh(speed / width)) - 1). `bend` is the wrist's
    angle in rad, `friction` the coefficient of friction, load in N m, width in rad/s, c without
    unit.

    Check: repeat the same motion with the wrist straight and bent; inspect the cable at the wrist.

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
    amplitudes = (Parameter("carried", "target / load", "fraction of the load", lower=0.0),)
    shape = (
        Parameter("friction", "1 / other_angle", "coefficient of friction", 0.03, 1.0, points=4),
        Parameter("width", "speed", "speed at which the tanh reaches 76 %", 1e-2, 50.0, points=6),
    )
    told_apart_by = "the same motion in several poses of the wrist"

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return one value or one array per amplitude."""
        wrap = shape[0] * np.abs(inputs["other_angle"])
        return (inputs["load"] * np.expm1(wrap * np.tanh(inputs["speed"] / shape[1])),)
