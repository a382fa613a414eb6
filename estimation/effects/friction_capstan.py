"""Capstan friction: friction of a cable wrapped over a surface, exponential in the wrap angle."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Pointwise, Row, Shape
from estimation.recording import FloatArray


class Capstan(Pointwise):
    """Friction of a cable over a constant wrap angle.

    Equation: torque = c load (exp(wrap sign(load) tanh(speed / width)) - 1). `wrap` is the
    coefficient of friction times the wrap angle, without unit; load in N m, width in rad/s, c
    without unit. The tension is multiplied by exp(wrap) when the cable is pulled against its load
    and divided by it when it is released. A load of the other sign is that of the other cable.

    Check: inspect the cable and its guides for wear and dirt; the ratio of the torques of pulling
    and releasing is exp(2 wrap).

    Source: the capstan equation of Euler and Eytelwein.
    """

    id = "friction.capstan"
    balances: ClassVar = {"cable": 1, "grasp": -1, "pitch": -1, "yaw": -1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "load": "distal_torque_n_m"}
    amplitudes = (Parameter("carried", "target / load", "fraction of the load", lower=0.0),)
    shape = (
        Parameter("wrap", "1", "coefficient of friction times angle of wrap", 0.03, 3.0, points=4),
        Parameter("width", "speed", "speed at which friction reaches 76 %", 1e-2, 50.0, points=6),
    )
    told_apart_by = "the same motion at another wrap angle, such as another pose of the wrist"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (_carried(inputs, shape[0], shape[1]),)


class WristCapstan(Capstan):
    """Friction of a cable that is wrapped over a joint by that joint's own angle.

    Equation: torque = c load (exp(friction |bend| sign(load) tanh(speed / width)) - 1). `bend` is
    the wrist's angle in rad, `friction` the coefficient of friction, load in N m, width in rad/s,
    c without unit.

    Check: repeat the same motion with the wrist straight and bent; inspect the cable at the wrist.

    Source: the capstan equation of Euler and Eytelwein, with the joint's angle as the wrap.
    """

    id = "friction.capstan.wrist"
    meaning = "friction of a cable that is wrapped over a joint by the angle of that joint"
    roles: ClassVar = {
        "speed": "motor_velocity_rad_s",
        "load": "distal_torque_n_m",
        "other_angle": "wrist_pitch_rad",
    }
    shape = (
        Parameter("friction", "1 / other_angle", "coefficient of friction", 0.03, 1.0, points=4),
        Parameter("width", "speed", "speed at which friction reaches 76 %", 1e-2, 50.0, points=6),
    )
    told_apart_by = "the same motion in several poses of the wrist"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (_carried(inputs, shape[0] * np.abs(inputs["other_angle"]), shape[1]),)


def _carried(inputs: Inputs, wrap: FloatArray | float, width: float) -> FloatArray:
    """Return the friction of a cable that is wrapped, for one unit of amplitude."""
    load, direction = inputs["load"], np.tanh(inputs["speed"] / width)
    return np.asarray(load * np.expm1(wrap * np.sign(load) * direction))
