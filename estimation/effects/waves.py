"""What the ripples share: sine and cosine of an order of an angle, and of its harmonics."""

from typing import ClassVar

import numpy as np

from estimation.effects.effect import Inputs, Parameter, Parameters, Pointwise, Row, Shape


def waves_in(unit: str) -> Parameters:
    """Return the amplitudes of a pure wave, in a unit."""
    return tuple(Parameter(wave, unit, f"amplitude of the {wave}") for wave in ("sine", "cosine"))


def harmonics_in(unit: str) -> Parameters:
    """Return the amplitudes of a wave and its harmonics, in a unit."""
    return tuple(
        Parameter(f"{wave}_{n}", unit, f"amplitude of the {wave} at {n} times the order")
        for n in (1, 2, 3)
        for wave in ("sine", "cosine")
    )


def order_of(role: str, lower: float, upper: float, points: int) -> Parameters:
    """Return the order of a wave over an angle or a position, with its range and its grid."""
    of = "periods per turn"
    return (Parameter("order", f"rad / {role}", of, lower, upper, linear=True, points=points),)


class Waves(Pointwise):
    """A periodic effect: the first role is its angle; a second one multiplies the waves.

    The first shape parameter is the order, periods per turn.
    """

    amplitudes: ClassVar[Parameters] = waves_in("target")

    @property
    def turning(self) -> str:
        """The role of the angle or the position that it repeats with."""
        return next(iter(self.roles))

    def orders(self, shape: Shape) -> list[float]:
        """Return the waves a turn of each column, in the order of the amplitudes."""
        return [(1 + k // 2) * float(shape[0]) for k in range(len(self.amplitudes))]

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return sine and cosine of each harmonic, in the order of the amplitudes."""
        angle, *load = (inputs[role] for role in self.roles)
        phase = shape[0] * angle
        count = len(self.amplitudes) // 2
        phases = [phase, *(n * phase for n in range(2, count + 1))]
        waves = [wave(x) for x in phases for wave in (np.sin, np.cos)]
        return [load[0] * wave for wave in waves] if load else waves
