"""Load-dependent static friction: friction that grows with the drive and sticks at standstill."""

from typing import ClassVar

import numba

from estimation.effects.effect import Parameter, Remembering
from estimation.effects.sticking import REST, SHAPE, advance
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    for i in range(len(now)):
        acting = advance(now[i, 0], now[i, 1], shape, state)
        rows[i, 0], rows[i, 1] = acting, acting * abs(now[i, 1])


class StickingLoadFriction(Remembering):
    """Friction of teeth and cables, proportional to the transmitted torque, also at standstill.

    Equation: torque = (F + mu |drive|) z; dz = d drive / (limit + share |drive|) + (sign(d travel)
    - z) |d travel| / reach, -1 <= z <= 1. F in N m, drive and limit in the unit of the drive (A or
    N m), reach in rad, mu in N m per unit of drive, share without unit.

    Check: repeat the same motion at two loads with pauses; inspect teeth and cable guides.

    Source: Karnopp 1985 and Dahl 1968 for z; Bittencourt and Gunnarsson 2012 for friction that
    grows with load.
    """

    id = "friction.load.sticking"
    family = "friction.load"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"travel": "motor_angle_rad", "drive": "motor_current_a"}
    amplitudes = (
        Parameter("friction", "target", "loss without load"),
        Parameter("loss", "target / drive", "fraction of the drive that is lost", lower=0.0),
    )
    shape = SHAPE
    walk = _walk
    rest = REST
    at_rest = True
    told_apart_by = "the same motion at two loads, with pauses"
