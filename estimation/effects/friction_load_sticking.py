"""Friction that grows with the load and sticks at rest."""

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
    """Teeth and cables that lose a share of what they carry; at rest they hold it.

    Equation: torque = (F + mu |drive|) z; dz = d drive / (limit + share |drive|) +
    (sign(d travel) - z) |d travel| / reach, -1 <= z <= 1.

    Source: Karnopp 1985 and Dahl 1968 for z; Bittencourt and Gunnarsson 2012 for friction that
    grows with load.
    """

    id = "friction.load.sticking"
    family = "friction.load"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {"travel": "motor_angle_rad", "drive": "motor_current_a"}
    amplitudes = (
        Parameter("friction", "target", "loss without load"),
        Parameter("loss", "target / drive", "share of the drive that is lost", lower=0.0),
    )
    shape = SHAPE
    walk = _walk
    rest = REST
    at_rest = True
    confused_with = (
        "friction.coulomb",
        "friction.load_viscous",
        "friction.position",
        "friction.capstan",
        "hysteresis.presliding",
    )
    told_apart_by = "the same motion at two loads, with rests on the way"
