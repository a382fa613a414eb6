"""Backlash: free travel that is crossed when the load changes its sign."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import Inputs, Parameter, Pointwise, Remembering, Row, Shape
from estimation.recording import FloatArray


class Backlash(Pointwise):
    """Play of teeth or keys, crossed when the load passes through zero.

    Equation: deflection = gap tanh((load - middle) / width), gap in rad, load, middle and width in
    N m. The middle is not zero where the sensor's zero is off. The play is crossed at a load far
    below the working load; a deflection that needs more load is a non-linear stiffness.

    Check: block the output, turn the input to and fro by hand and measure the free travel.

    Source: Nordin and Gutman 2002 (models of mechanical systems with backlash), the dead zone as a
    function of the load, with smooth edges.
    """

    id = "transmission.backlash"
    balances: ClassVar = {"gearbox": 1, "stretch": -1}
    roles: ClassVar = {"load": "proximal_torque_n_m"}
    amplitudes = (Parameter("gap", "target", "half the free travel", lower=0.0),)
    shape = (
        Parameter("width", "load", "load at which 76 % of it acts", 5e-4, 0.015, points=6),
        Parameter("middle", "load", "load in the middle", -0.1, 0.1, True, points=7),
    )
    told_apart_by = "a load that passes slowly through zero, in both directions"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (np.tanh((inputs["load"] - shape[1]) / shape[0]),)


@numba.njit(cache=True)
def _walk_play(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Fill the rows; state: started (0 or 1), the last travel, the place in the play -1 to 1."""
    for i in range(len(now)):
        moved = (now[i, 0] - state[1]) / shape[0] if state[0] else 0.0
        state[0], state[1] = 1.0, now[i, 0]
        state[2] = min(max(state[2] + moved, -1.0), 1.0)
        rows[i, 0] = state[2]


class Play(Remembering):
    """Free travel of the driving end while friction holds the driven end at standstill.

    Equation: deflection = gap z; z follows travel / reach and stays within -1 and 1, z = 0 at the
    start. gap in rad, reach in rad.

    Check: reverse slowly under a load of constant sign and measure the free travel.

    Source: Nordin and Gutman 2002 (models of mechanical systems with backlash), the play operator.
    """

    id = "transmission.backlash.play"
    meaning = "free travel of the driving end while friction holds the driven end"
    family = "transmission.backlash"
    balances: ClassVar = {"stretch": -1}
    roles: ClassVar = {"travel": "spindle_angle_rad"}
    amplitudes = (Parameter("gap", "target", "half the free travel", lower=0.0),)
    shape = (Parameter("reach", "travel", "half the travel that crosses it", 1e-3, 0.5),)
    walk = _walk_play
    rest = (0.0, 0.0, 0.0)
    told_apart_by = "slow reversals under a load of constant sign"
