"""Eccentricity: a lever arm that varies over a turn, so that the load causes a periodic torque."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Parameters
from estimation.effects.ripple_output import OutputHarmonics
from estimation.effects.waves import Waves, harmonics_in, order_of


class EccentricLoad(Waves):
    """A pulley or a gear that is off centre. The order need not be an integer.

    Equation: torque = load (a sin(order angle) + b cos(order angle)), load in N m, angle in rad, a
    and b without unit, order in periods per turn.

    Check: measure the runout of pulleys and gears with a dial gauge.

    Source: the moment of a force about an axis: a lever arm r + e cos(angle) in place of r.
    """

    id = "eccentric.load"
    balances: ClassVar = {"motor": -1, "gearbox": 1, "cable": 1, "stretch": 1, "grasp": -1}
    roles: ClassVar = {"output_angle": "spindle_angle_rad", "load": "motor_load_n_m"}
    amplitudes: ClassVar[Parameters] = (
        Parameter("sine", "target / load", "eccentricity along one axis, of the lever arm"),
        Parameter("cosine", "target / load", "eccentricity along the other"),
    )
    shape = order_of("output_angle", 0.5, 16.5, points=33)
    told_apart_by = "the same sweep against two loads"


class EccentricHarmonics(EccentricLoad):
    """A pulley or a gear whose lever arm varies over a turn, not as a pure sine.

    Equation: torque = load sum over n = 1, 2, 3 of (a_n sin(n order angle) + b_n cos(n order
    angle)), load in N m, angle in rad, a_n and b_n without unit, order in periods per turn.

    Check: measure the runout of pulleys and gears with a dial gauge.

    Source: the moment of a force about an axis: a lever arm r(angle) in place of r.
    """

    id = "eccentric.load.harmonics"
    meaning = (
        "a lever arm that varies over a turn, not as a pure sine, so that the load"
        " causes a periodic torque"
    )
    amplitudes = harmonics_in("target / load")


class EccentricPulley(OutputHarmonics):
    """A pulley or a gear that is not round: it moves its output and changes its own lever arm.

    Equation: travel = A(angle) = sum over n = 1, 2, 3 of a_n sin(n order angle) + b_n cos(n order
    angle), a_n and b_n in the target's unit (rad), angle in rad, order in periods per turn. The
    torque of the load behind it changes by load dA/dangle: neither takes energy from the motion. A
    ripple of an encoder has the travel alone.

    Check: measure the runout of pulleys and gears with a dial gauge.

    Source: the principle of virtual work; Goldstein, "Classical Mechanics", section 1.4.
    """

    id = "eccentric.load.pulley"
    meaning = "a pulley or gear that is not round: it moves its output and changes its lever arm"
    family = "eccentric.load"
    balances: ClassVar = {"gearbox": 1, "stretch": 1}
    amplitudes = harmonics_in("target")
    shape = order_of("output_angle", 0.5, 16.5, points=33)
    told_apart_by = "the same sweep against two loads"
