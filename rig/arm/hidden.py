"""Hidden torque of an arm's joints by families of effects, each joint with a form drawn anew.

The recipes are those of the simulated rigs (`rig.simulation.varied`): tables of random functions
and banks of elements with memory, so the form of a hidden effect is drawn, not written. A joint
takes the place of the recipes' spindle, or of their motor where the form is over another joint.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numba
import numpy as np

from estimation.arm.elements import slip
from estimation.arm.motion import Motion
from estimation.recording import FloatArray
from rig.simulation.varied.drawn import Ranges
from rig.simulation.varied.frictions import FRICTIONS, LOOPS
from rig.simulation.varied.hidden import Hidden
from rig.simulation.varied.outside import OUTSIDE
from rig.simulation.varied.plant import draw_plant

OWN = "the simulation's own"
"""The written form that a study's paper was matched with."""

IN_CATALOGUE = {
    "loop after reversals": "hysteresis.presliding spindle",
    "friction that falls with speed": "friction.stribeck spindle",
    "friction along the angle": "friction.position spindle",
    "bent drag": "friction.drag spindle",
    "friction that changes with time": "friction.warmup spindle",
}
"""Family to its recipe. The catalogue of effects has the family, not the drawn form."""

NOT_IN_CATALOGUE = {
    "friction by another joint's angle": "friction.position motor",
    "friction at tight spots": "unknown spindle tight spot",
    "friction by acceleration": "unknown spindle pushed",
    "drag on a part of the travel": "unknown spindle drag beyond",
    "friction switched by speed": "unknown spindle switching",
}
"""The same for functions of variables that no effect of the catalogue has."""

FAMILIES = (OWN, *IN_CATALOGUE, *NOT_IN_CATALOGUE)

SIGN_SHARE = 0.02
"""Speed over which a friction changes its sign, as a share of a joint's usual highest."""


@dataclass(frozen=True, eq=False)
class HiddenTorque:
    """A drawn hidden torque of every joint.

    Attributes:
        parts: Of each joint, the drawn effect.
        over: Of each joint, the joint whose angle its form is over.
        fast: Of each joint, its usual highest speed, rad/s or m/s.
        amplitude: Of each joint, N m or N: what makes it as large as asked on the motion it was
            drawn on.
    """

    parts: tuple[Hidden, ...]
    over: tuple[int, ...]
    fast: FloatArray
    amplitude: FloatArray

    def __call__(self, motion: Motion) -> FloatArray:
        """Return the torque along a motion, shape (n, joints)."""
        columns = [
            _along(part, _channels(motion, k, over), self.fast[k])
            for k, (part, over) in enumerate(zip(self.parts, self.over, strict=True))
        ]
        torque: FloatArray = self.amplitude * np.column_stack(columns)
        return torque


def names_of(family: str) -> tuple[str, ...]:
    """Return the catalogue's names of a family; none where the catalogue does not have it."""
    if family == OWN:
        return LOOPS
    name = IN_CATALOGUE.get(family, "").partition(" ")[0]
    return LOOPS if name in LOOPS else (name,) if name else ()


def draw_hidden(
    family: str, rng: np.random.Generator, motion: Motion, rms: FloatArray
) -> HiddenTorque:
    """Draw a hidden torque.

    Args:
        family: One of `FAMILIES` but `OWN`.
        rng: Source of the forms.
        motion: A motion; the forms are laid out over its ranges.
        rms: Standard deviation of each joint's torque along that motion, shape (joints,).
    """
    recipe = {**FRICTIONS, **OUTSIDE}[{**IN_CATALOGUE, **NOT_IN_CATALOGUE}[family]]
    joints = motion.position.shape[1]
    plant = draw_plant(rng)  # of a drawn rig's sizes none is kept: the amplitude is set here
    parts, over = [], []
    for k in range(joints):
        other = (k + 1) % joints if recipe is FRICTIONS["friction.position motor"] else k
        parts.append(recipe(rng, _ranges(motion, k, other), plant).part)
        over.append(other)
    fast = np.percentile(np.abs(motion.velocity), 99.5, axis=0)
    unit = HiddenTorque(tuple(parts), tuple(over), fast, np.ones(joints))  # type: ignore[arg-type]
    spread = np.std(unit(motion), axis=0)
    return HiddenTorque(unit.parts, unit.over, fast, rms / np.where(spread > 0, spread, 1.0))


def _channels(motion: Motion, joint: int, over: int) -> dict[str, FloatArray]:
    """Return the recipes' variables of a joint: it is the motor, and the other is the spindle."""
    time = np.arange(len(motion)) * motion.period_s
    own, other = motion.velocity[:, joint], motion.velocity[:, over]
    return {
        "motor_angle": motion.position[:, joint],
        "motor_speed": own,
        "motor_way": np.abs(own),
        "spindle_angle": motion.position[:, over],
        "spindle_speed": other,
        "spindle_way": np.abs(other),
        "acceleration": motion.acceleration[:, joint],
        "run_time": time,
        "campaign_time": time,
    }


def _ranges(motion: Motion, joint: int, over: int) -> Ranges:
    channels = _channels(motion, joint, over)
    low, high = (
        {name: float(np.percentile(x, share)) for name, x in channels.items()}
        for share in (0.5, 99.5)
    )
    usual = {name: float(np.median(np.abs(x))) for name, x in channels.items()}
    seconds = len(motion) * motion.period_s
    return Ranges(low, high, usual, seconds, seconds)


def _along(part: Hidden, channels: Mapping[str, FloatArray], fast: float) -> FloatArray:
    """Return a drawn effect's value along channels, shape (n,)."""
    first, *factors = part.tables
    value = OPERATORS[part.operator](part, channels[first.variable])
    for table in factors:
        value = value * table.at(channels[table.variable])
    if part.friction:
        value = value * np.tanh(channels[f"{part.place}_speed"] / (SIGN_SHARE * fast))
    return value


def _stops(part: Hidden, x: FloatArray) -> FloatArray:
    elements = [slip(x[:, None], float(reach))[:, 0] for reach in part.reach]
    return np.column_stack(elements) @ part.weights


def _relays(part: Hidden, x: FloatArray) -> FloatArray:
    """Return relays side by side; each starts off and keeps its state between its thresholds."""
    half = len(part.reach) // 2
    count = len(part.weights)
    switched = (x[:, None] > part.reach[:count]).astype(np.float64)
    switched -= x[:, None] < part.reach[half : half + count]
    at = np.where(switched != 0, np.arange(len(x))[:, None], 0)
    state = np.take_along_axis(switched, np.maximum.accumulate(at, axis=0), axis=0)
    return np.asarray(state @ part.weights)


def bouc_wen(
    position: FloatArray, reach: FloatArray, sharpness: float = 1.0, loads: float = 1.0
) -> FloatArray:
    """Return loops after Bouc and Wen, between -1 and 1; by default Dahl's friction.

    Args:
        position: Shape (n, joints).
        reach: Displacement of the turn, shape (joints,).
        sharpness: Exponent.
        loads: Share of the loop that differs by direction; with 1 the loop is Dahl's
            ("Solid friction damping of mechanical vibrations", AIAA Journal 14(12), 1976).
    """
    state: FloatArray = _bouc_wen(np.ascontiguousarray(position), reach, sharpness, loads)
    return state


@numba.njit(cache=True)
def _bouc_wen(position, reach, sharpness, loads):  # type: ignore[no-untyped-def]
    state = np.zeros_like(position)
    for k in range(1, len(position)):
        for j in range(position.shape[1]):
            z = state[k - 1, j]
            way = (position[k, j] - position[k - 1, j]) / reach[j]
            side = 1.0 if way * z > 0.0 else -1.0
            z += way * (1.0 - abs(z) ** sharpness * (loads * side + 1.0 - loads))
            state[k, j] = min(max(z, -1.0), 1.0)
    return state


def _loop(part: Hidden, x: FloatArray) -> FloatArray:
    reach, sharpness, loads = part.reach
    return bouc_wen(x[:, None], np.array([reach]), float(sharpness), float(loads))[:, 0]


OPERATORS: Mapping[str, Callable[[Hidden, FloatArray], FloatArray]] = {
    "table": lambda part, x: part.tables[0].at(x),
    "stops": _stops,
    "relays": _relays,
    "bouc_wen": _loop,
}
