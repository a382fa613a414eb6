"""Hidden torque of an arm's joints by families of effects, each joint with a form of its own.

The forms are random tables and banks of elements with memory (`rig.simulation.forms`), so the form
of a hidden effect is drawn, not written.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numba
import numpy as np

from estimation.arm.effects import slip
from estimation.arm.motion import Motion
from estimation.recording import FloatArray
from rig.simulation.forms import (
    Random,
    bank,
    course,
    falling,
    grid,
    power,
    rising,
    smooth,
    spots,
)

OWN = "the simulation's own"
"""The written form that a study's paper was matched with."""

SIGN_SHARE = 0.02
"""Speed over which a friction changes its sign, as a share of a joint's usual highest."""

LOOPS = ("hysteresis.presliding", "hysteresis.bouc_wen")


@dataclass(frozen=True, eq=False)
class Joint:
    """The variables of a joint's hidden torque along a motion; each of shape (n,).

    `other` is the angle of the next joint.
    """

    angle: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    other: FloatArray
    time_s: FloatArray


Torque = Callable[[Joint], FloatArray]
Drawer = Callable[[Random, Joint], Torque]
"""Draws a torque, its form laid out over the ranges of a joint's motion."""


def _over(x: FloatArray, form: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return a form on the unit grid as a function over the usual range of a variable."""
    low, high = np.percentile(x, [0.5, 99.5])
    margin = 0.15 * (high - low)
    at = np.linspace(low - margin, high + margin, len(form))
    return lambda values: np.interp(values, at, form)


def _sized(x: FloatArray, form: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return a form on the unit grid as a function of a variable's size, from 0."""
    at = np.linspace(0.0, 1.15 * float(np.percentile(np.abs(x), 99.5)), len(form))
    return lambda values: np.interp(np.abs(values), at, form)


def _loop(random: Random, reference: Joint) -> Torque:
    span = float(np.ptp(np.percentile(reference.angle, [0.5, 99.5])))
    kind, reach, weights = bank(random, span * float(np.exp(random.uniform(*np.log([0.02, 0.15])))))
    if kind == "bouc_wen":
        turn, sharpness, loads = reach
        return lambda j: bouc_wen(j.angle[:, None], np.array([turn]), sharpness, loads)[:, 0]
    return lambda j: np.column_stack([slip(j.angle[:, None], r)[:, 0] for r in reach]) @ weights


def _friction(
    variable: str,
    form: Callable[[Random], FloatArray],
    over: Callable[[FloatArray, FloatArray], Callable[[FloatArray], FloatArray]],
) -> Drawer:
    """Return the drawer of a friction whose level is a form over one variable of a joint."""

    def draw(random: Random, reference: Joint) -> Torque:
        level = over(getattr(reference, variable), form(random))
        return _signed(reference, lambda joint: level(getattr(joint, variable)))

    return draw


def _signed(reference: Joint, level: Torque) -> Torque:
    width = SIGN_SHARE * float(np.percentile(np.abs(reference.speed), 99.5))
    return lambda joint: level(joint) * np.tanh(joint.speed / width)


def _along(random: Random) -> FloatArray:
    forms = (rising(random), 1.0 - rising(random), np.exp(0.8 * smooth(random, 0.7)))
    form = forms[int(random.integers(len(forms)))]
    return np.asarray(form - form.min())


def _course(random: Random) -> FloatArray:
    form = course(random, grid())
    return np.asarray(form - form.min())


def _pushed(random: Random) -> FloatArray:
    form = falling(random, grid() / random.uniform(0.05, 0.2))
    return form if random.random() < 0.5 else 1.0 - form


def _drag(random: Random, reference: Joint) -> Torque:
    size = _sized(reference.speed, power(random, 1.7, 3.0)(grid()))
    return lambda j: size(j.speed) * np.sign(j.speed)


def _beyond(random: Random, reference: Joint) -> Torque:
    x = grid() - random.uniform(0.35, 0.65)
    side = 0.5 + 0.5 * np.tanh(x / random.uniform(0.03, 0.1)) * random.choice([-1.0, 1.0])
    share = _over(reference.angle, side)
    return lambda j: share(j.angle) * j.speed


def _switched(random: Random, reference: Joint) -> Torque:
    fast = np.percentile(np.abs(reference.speed), 99.5)
    on, off = random.uniform(0.35, 0.6) * fast, random.uniform(0.08, 0.25) * fast
    return _signed(reference, lambda j: _relay(np.abs(j.speed), on, off))


_falling = _friction("speed", lambda r: falling(r, grid() / r.uniform(0.05, 0.3)), _sized)

IN_CATALOGUE: Mapping[str, tuple[tuple[str, ...], Drawer]] = {
    "loop after reversals": (LOOPS, _loop),
    "friction that falls with speed": (("friction.stribeck",), _falling),
    "friction along the angle": (("friction.position",), _friction("angle", _along, _over)),
    "curved drag": (("friction.drag",), _drag),
    "friction that changes with time": (("friction.warmup",), _friction("time_s", _course, _sized)),
}
"""Family to the catalogue's names of it. The catalogue has the family, not the drawn form."""

NOT_IN_CATALOGUE: Mapping[str, Drawer] = {
    "friction by another joint's angle": _friction("other", _along, _over),
    "friction at tight spots": _friction("angle", spots, _over),
    "friction by acceleration": _friction("acceleration", _pushed, _sized),
    "drag on a part of the travel": _beyond,
    "friction switched by speed": _switched,
}
"""The same for functions of variables that no effect of the catalogue has."""

FAMILIES = (OWN, *IN_CATALOGUE, *NOT_IN_CATALOGUE)


def names_of(family: str) -> tuple[str, ...]:
    """Return the catalogue's names of a family; none where the catalogue does not have it."""
    return LOOPS if family == OWN else IN_CATALOGUE[family][0] if family in IN_CATALOGUE else ()


@dataclass(frozen=True, eq=False)
class HiddenTorque:
    """A drawn hidden torque of every joint."""

    parts: tuple[Torque, ...]  # of each joint, the drawn torque
    # of each joint, N m or N: what makes it as large as asked on the motion it was drawn on
    amplitude: FloatArray

    def __call__(self, motion: Motion) -> FloatArray:
        """Return the torque along a motion, shape (n, joints)."""
        columns = [part(_joint(motion, k)) for k, part in enumerate(self.parts)]
        return self.amplitude * np.column_stack(columns)


def draw_hidden(family: str, rng: Random, motion: Motion, rms: FloatArray) -> HiddenTorque:
    """Draw a hidden torque of one of `FAMILIES` but `OWN`, laid out over the ranges of a motion.

    `rms` is the standard deviation of each joint's torque along that motion, shape (joints,).
    """
    drawer = IN_CATALOGUE[family][1] if family in IN_CATALOGUE else NOT_IN_CATALOGUE[family]
    joints = motion.position.shape[1]
    unit = HiddenTorque(
        tuple(drawer(rng, _joint(motion, k)) for k in range(joints)), np.ones(joints)
    )
    spread = np.std(unit(motion), axis=0)
    return HiddenTorque(unit.parts, rms / np.where(spread > 0, spread, 1.0))


def _joint(motion: Motion, k: int) -> Joint:
    return Joint(
        motion.position[:, k],
        motion.velocity[:, k],
        motion.acceleration[:, k],
        motion.position[:, (k + 1) % motion.position.shape[1]],
        motion.period_s * np.arange(len(motion), dtype=np.float64),
    )


def _relay(x: FloatArray, on: float, off: float) -> FloatArray:
    """Return a relay, shape (n,), which keeps its state between its thresholds."""
    switched = (x > on).astype(np.float64) - (x < off)
    at = np.where(switched != 0, np.arange(len(x)), 0)
    return switched[np.maximum.accumulate(at)]


def bouc_wen(
    position: FloatArray, reach: FloatArray, sharpness: float = 1.0, loads: float = 1.0
) -> FloatArray:
    """Return loops after Bouc and Wen, between -1 and 1, of positions (n, joints).

    By default they are Dahl's friction ("Solid friction damping of mechanical vibrations", AIAA
    Journal 14(12), 1976). `reach` is each joint's displacement of the turn, `sharpness` the
    exponent, `loads` the share of the loop that differs by direction.
    """
    return np.asarray(_bouc_wen(np.ascontiguousarray(position), reach, sharpness, loads))


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
