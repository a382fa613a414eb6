"""Backlash by travel: free travel that is crossed after each reversal."""

from typing import ClassVar

import numba

from estimation.effects.effect import Parameter, Remembering
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
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
    family = "transmission.backlash"
    balances: ClassVar = {"stretch": -1}
    roles: ClassVar = {"travel": "spindle_angle_rad"}
    amplitudes = (Parameter("gap", "target", "half the free travel", lower=0.0),)
    shape = (Parameter("reach", "travel", "half the travel that crosses it", 1e-3, 0.5),)
    walk = _walk
    rest = (0.0, 0.0, 0.0)
    told_apart_by = "slow reversals under a load of constant sign"
