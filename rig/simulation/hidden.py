"""Hidden effects: physics the simulated rig can hold and an estimator's model does not declare.

Each effect is a compiled function (`hidden_drive`, `hidden_cable`, `hidden_sensors`) of the plant's
own quantities and one row of a table, kept here: a strength and up to two numbers that shape it.
Strength 0 does not change the plant at all. Strength 1
is clear but not dominant. On the default rig, low-passed at 50 Hz, effects of drive and gear are
a quarter to three quarters of the residual variance of a linear equation of motor current; effects
of cable and jaw add 4 to 7 mN m rms to proximal torque or 1 to 5 mrad to the jaw angle.

The forms are these modules' own and are deliberately not those an estimator would try first
(rational functions in place of exponentials, side bands, contact damping), so that finding an
effect is not recognising one's own formula.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.errors import UsageError
from rig.simulation.hidden_kinds import KINDS, STRENGTH, SUMS, TABLE, WEAKEST

NAMES: tuple[str, ...] = tuple(kind.name for kind in KINDS)


class UnknownHiddenEffectError(UsageError):
    """The configuration names a hidden effect that does not exist, or shapes it wrongly."""


@dataclass(frozen=True, slots=True)
class HiddenEffect:
    """One hidden effect switched on.

    Attributes:
        name: One of `NAMES`.
        strength: 0 is off, 1 is clear.
        shape: The numbers of `Kind.shapes` in order; those left out take the middle of their range.
    """

    name: str
    strength: float = 1.0
    shape: tuple[float, ...] = ()


def draw(seed: int) -> HiddenEffect:
    """Pick one effect that shows by itself, its strength and its shape by seed."""
    generator = np.random.default_rng(seed)
    kinds = [kind for kind in KINDS if kind.alone]
    kind = kinds[int(generator.integers(len(kinds)))]
    strength = float(generator.uniform(WEAKEST, kind.strongest))
    return HiddenEffect(kind.name, strength, tuple(part.drawn(generator) for part in kind.shapes))


def table(effects: Iterable[HiddenEffect]) -> NDArray[np.void]:
    """Return the table the compiled plant reads: one record of `hidden_kinds.TABLE`.

    Raises:
        UnknownHiddenEffectError: A name is unknown, a strength is negative or not finite, a kind is
            named twice, or a shape has too many numbers.
    """
    rows = np.zeros(1, TABLE)
    for kind in KINDS:  # read at strength 0 too, to no effect
        rows[kind.name][0, 1 : 1 + len(kind.shapes)] = [shape.middle for shape in kind.shapes]
    for effect in effects:
        if effect.name not in NAMES:
            raise UnknownHiddenEffectError(
                f"Unknown hidden effect {effect.name!r}.", f"Known: {', '.join(NAMES)}."
            )
        shapes, row = KINDS[NAMES.index(effect.name)].shapes, rows[effect.name][0]
        if not 0.0 <= effect.strength < math.inf:
            raise UnknownHiddenEffectError(
                f"Hidden effect {effect.name!r} has strength {effect.strength}.",
                "A strength is a finite number, 0 or more.",
            )
        if row[STRENGTH]:
            raise UnknownHiddenEffectError(f"Hidden effect {effect.name!r} is named twice.")
        if len(effect.shape) > len(shapes):
            raise UnknownHiddenEffectError(
                f"Hidden effect {effect.name!r} is shaped by {len(effect.shape)} numbers.",
                f"It takes: {', '.join(shape.name for shape in shapes)}.",
            )
        row[: 1 + len(effect.shape)] = [effect.strength, *effect.shape]
    for name, parts in SUMS.items():
        rows[name] = any(rows[part][0, STRENGTH] for part in parts)
    return rows


def chosen(words: Sequence[str] | None, seed: int) -> dict[str, float]:
    """Return the hidden effects requested by the user: effect to strength.

    Args:
        words: `effect` or `effect=strength`; `none` alone for nothing; one drawn by seed when there
            are no words.
        seed: Seed of the draw.

    Raises:
        UnknownHiddenEffectError: A name is unknown or a strength is not a number.
    """
    if not words:
        drawn = draw(seed)
        return {drawn.name: round(drawn.strength, 3)}
    if list(words) == ["none"]:
        return {}
    found = {}
    for word in words:
        name, _, strength = word.partition("=")
        try:
            found[name] = float(strength or 1.0)
        except ValueError as error:
            raise UnknownHiddenEffectError(
                f"{strength!r} is not a strength.", "Write for example motor_ripple=0.5."
            ) from error
    table(HiddenEffect(name, strength) for name, strength in found.items())
    return found
