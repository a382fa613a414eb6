"""Position-dependent static friction: friction that varies along the travel and sticks."""

from typing import ClassVar

import numba

from estimation.effects.effect import Parameter, Remembering
from estimation.effects.sticking import REST, SHAPE, advance
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    for i in range(len(now)):
        acting = advance(now[i, 0], now[i, 1], shape, state)
        for k in range(rows.shape[1]):
            rows[i, k] = acting
            acting *= now[i, 2]


class StickingPositionFriction(Remembering):
    """Friction of guides, gears and cables that varies along the travel, also at standstill.

    Equation: torque = (F + a x + b x^2 + c x^3) z, x the position in rad; dz = d drive / (limit +
    share |drive|) + (sign(d travel) - z) |d travel| / reach, -1 <= z <= 1. F in N m, a in N m/rad,
    b in N m/rad^2, c in N m/rad^3, limit in the unit of the drive, reach in rad, share without
    unit.

    Check: move slowly over the whole travel at two loads with pauses, and inspect the places of
    large friction.

    Source: Karnopp 1985 and Dahl 1968 for z; Armstrong-Helouvry 1991, "Control of machines with
    friction", for friction that depends on position.
    """

    id = "friction.position.sticking"
    family = "friction.position"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {
        "travel": "motor_angle_rad",
        "drive": "motor_current_a",
        "position": "spindle_angle_rad",
    }
    amplitudes = (
        Parameter("friction", "target", "loss at position 0"),
        Parameter("slope", "target / position", "linear change with position"),
        Parameter("bend", "target / position / position", "quadratic change with position"),
        Parameter("twist", "target / position / position / position", "cubic change with position"),
    )
    shape = SHAPE
    walk = _walk
    rest = REST
    at_rest = True
    told_apart_by = "slow sweeps over the whole travel, at two loads, with pauses"
