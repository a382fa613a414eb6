"""The travel of a pulley that is not round: the other half of an eccentricity."""

from typing import ClassVar

from estimation.effects.effect import Parameter
from estimation.effects.harmonics import harmonics_in
from estimation.effects.ripple_output_harmonics import OutputHarmonics


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
    family = "eccentric.load"
    balances: ClassVar = {"gearbox": 1, "stretch": 1}
    amplitudes = harmonics_in("target")
    shape = (Parameter("order", "1", "periods per turn", 0.5, 16.5, linear=True, points=33),)
    told_apart_by = "the same sweep against two loads"
