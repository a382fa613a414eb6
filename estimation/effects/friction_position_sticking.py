"""Friction that changes along the travel and sticks at rest."""

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
    """Guides, gears and cables that are tighter in one place than in another; at rest they hold.

    Equation: torque = (F + a x + b x^2 + c x^3) z, x the position; dz = d drive / (limit +
    share |drive|) + (sign(d travel) - z) |d travel| / reach, -1 <= z <= 1.

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
        Parameter("slope", "target / position", "its change with position"),
        Parameter("bend", "target / position / position", "its change with position squared"),
        Parameter("twist", "target / position / position / position", "with position cubed"),
    )
    shape = SHAPE
    walk = _walk
    rest = REST
    at_rest = True
    confused_with = (
        "friction.coulomb",
        "friction.load",
        "friction.coulomb_asymmetry",
        "spring.position",
        "hysteresis.presliding",
    )
    told_apart_by = "slow sweeps over the whole travel, at two loads, with rests on the way"
