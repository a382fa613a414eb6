"""Eccentricity with harmonics: a lever arm that varies over a turn in any periodic way."""

from collections.abc import Mapping, Sequence
from typing import Any

from estimation.effects.eccentric_load import EccentricLoad
from estimation.effects.effect import Parameter
from estimation.effects.harmonics import harmonics, harmonics_in


class EccentricHarmonics(EccentricLoad):
    """A pulley or a gear whose lever arm varies over a turn, not as a pure sine.

    Equation: torque = load sum over n = 1, 2, 3 of (a_n sin(n order angle) + b_n cos(n order
    angle)), load in N m, angle in rad, a_n and b_n without unit, order in periods per turn.

    Check: measure the runout of pulleys and gears with a dial gauge.

    Source: the moment of a force about an axis: a lever arm r(angle) in place of r.
    """

    id = "eccentric.load.harmonics"
    family = "eccentric.load"
    amplitudes = harmonics_in("target / load")
    shape = (Parameter("order", "1", "periods per turn", 0.5, 16.5, linear=True, points=33),)

    def row(self, inputs: Mapping[str, Any], shape: Sequence[float]) -> Sequence[Any]:
        """Return sine and cosine of each harmonic, times the load."""
        return [inputs["load"] * x for x in harmonics(shape[0] * inputs["output_angle"])]
