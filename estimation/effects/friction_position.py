"""Position-dependent friction: friction that varies along the travel."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import Inputs, Parameter, Pointwise, Remembering, Row, Shape
from estimation.effects.memory import REST, SHAPE, advance
from estimation.recording import FloatArray


class PositionFriction(Pointwise):
    """Friction of a track, a hose or a cable that is larger at some positions than at others.

    Equation: torque = (a position + b position^2 + c position^3) tanh(speed / width), in addition
    to Coulomb friction. position in rad, width in rad/s, a in N m/rad, b in N m/rad^2, c in
    N m/rad^3.

    Check: move slowly over the whole travel without load in both directions, and inspect the places
    of large friction.

    Source: Popovic and Goldenberg 1998 (friction of a drive as a function of its position).
    """

    id = "friction.position"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "position": "spindle_angle_rad"}
    amplitudes = (
        Parameter("slope", "target / position", "linear change with position"),
        Parameter("bend", "target / position / position", "quadratic change with position"),
        Parameter("twist", "target / position / position / position", "cubic change with position"),
    )
    shape = (Parameter("width", "speed", "speed at which friction reaches 76 %", 1e-3, 1e2),)
    told_apart_by = "a slow sweep without load, in both directions"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        along = inputs["position"] * np.tanh(inputs["speed"] / shape[0])
        square = inputs["position"] * along
        return along, square, inputs["position"] * square


class ViscousPositionFriction(Pointwise):
    """A seal, a screw or a cable whose viscous friction is larger at some positions than at others.

    Equation: torque = (a position + b position^2) speed, in addition to viscous friction. position
    in rad, speed in rad/s, a in N m s/rad^2, b in N m s/rad^3.

    Check: move over the whole travel at two speeds without load, and inspect lubrication and
    alignment where the friction is large.

    Source: Popovic and Goldenberg 1998 (friction of a drive as a function of its position).
    """

    id = "friction.position.viscous"
    meaning = "viscous friction that varies along the travel"
    family = "friction.position"
    balances: ClassVar = PositionFriction.balances
    roles: ClassVar = PositionFriction.roles
    amplitudes = (
        Parameter("slope", "target / speed / position", "linear change with position"),
        Parameter("bend", "target / speed / position / position", "quadratic change with position"),
    )
    told_apart_by = "sweeps without load at two speeds, in both directions"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        along = inputs["position"] * inputs["speed"]
        return along, inputs["position"] * along


@numba.njit(cache=True)
def _walk_sticking(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
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
    meaning = "friction that varies along the travel, also at standstill"
    family = "friction.position"
    balances: ClassVar = {"motor": -1, "grasp": -1}
    roles: ClassVar = {
        "travel": "motor_angle_rad",
        "drive": "motor_current_a",
        "position": "spindle_angle_rad",
    }
    amplitudes = (
        Parameter("friction", "target", "loss at position 0"),
        *PositionFriction.amplitudes,
    )
    shape = SHAPE
    walk = _walk_sticking
    rest = REST
    at_rest = True
    told_apart_by = "slow sweeps over the whole travel, at two loads, with pauses"
