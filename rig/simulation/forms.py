"""Random functions on a grid: what distorts a hidden effect's form, or makes it.

All are tables over a range of one variable, shape (`POINTS`,); between its points a table is linear
and beyond its ends it stays at its last value.
"""

import math
from collections.abc import Callable

import numpy as np

from estimation.recording import FloatArray

POINTS = 129
WAVES = 24
BANK = 40  # Most elements side by side of an operator with memory

Random = np.random.Generator
Form = Callable[[FloatArray], FloatArray]


def grid() -> FloatArray:
    """Return the unit grid that forms are drawn on."""
    return np.linspace(0.0, 1.0, POINTS)


def smooth(random: Random, scale: float) -> FloatArray:
    """Return one draw of a Gaussian process on the unit grid: mean 0, variance 1.

    Made of random waves (Rahimi and Recht 2007) of a squared-exponential kernel.

    The length scale is a share of the range.
    """
    rates = random.standard_normal(WAVES) / scale
    phases = random.uniform(0.0, 2.0 * np.pi, WAVES)
    waves = np.cos(np.outer(grid(), rates) + phases)
    return np.asarray(np.sqrt(2.0 / WAVES) * waves.sum(axis=1))


def bend(random: Random, most: float = 0.45) -> FloatArray:
    """Return a positive factor about 1 on the unit grid: exp of a smooth draw."""
    depth = random.uniform(0.1, most)
    return np.exp(depth * smooth(random, float(random.uniform(0.25, 0.8))))


def rising(random: Random) -> FloatArray:
    """Return a random function that rises from 0 to 1: the integral of a bend's square."""
    rate = bend(random, 0.9) ** 2
    total = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))])
    return np.asarray(total / total[-1])


def falling(random: Random, x: FloatArray) -> FloatArray:
    """Return a form that falls from 1 at 0 towards 0 beyond 1, of a random kind, distorted.

    It is taken at x, 0 and more, shape (`POINTS`,).
    """
    power = random.uniform(0.8, 2.5)
    kinds = (
        np.exp(-(x**power)),
        1.0 / (1.0 + x**power),
        1.0 - np.tanh(x**power),
        np.log1p(1.0 / (x**power + 1.0 / (math.e - 1.0))),
        np.clip(1.0 - 0.5 * x, 0.0, None) ** power,
    )
    form = kinds[int(random.integers(len(kinds)))] * bend(random)
    return np.asarray(form / form[0])


def spots(random: Random, most: int = 2, narrow: float = 0.04, wide: float = 0.12) -> FloatArray:
    """Return one or a few local features on the unit grid: bumps of random shapes and places."""
    x, total = grid(), np.zeros(POINTS)
    for _ in range(int(random.integers(1, most + 1))):
        centre, width = random.uniform(0.2, 0.8), random.uniform(narrow, wide)
        d = np.abs(x - centre) / width
        power = random.uniform(1.2, 3.0)
        shapes = (np.exp(-0.5 * d**power), 1.0 / (1.0 + d**2) ** power, np.clip(1 - d / 2, 0, None))
        total += random.uniform(0.5, 1.0) * shapes[int(random.integers(len(shapes)))]
    return np.asarray(total / total.max())


def course(random: Random, x: FloatArray) -> FloatArray:
    """Return how something drifts, from 0, of a random kind: towards a level, slower, in seasons.

    It is taken at times x, shares of the whole, shape (n,).
    """
    time = random.uniform(0.1, 0.6)
    kinds = (
        1.0 - np.exp(-x / time),
        np.log1p(x / (0.2 * time)),
        x / (x + time),
        x.copy(),
        np.sin(2.0 * np.pi * random.uniform(0.4, 1.2) * x),
    )
    form = kinds[int(random.integers(len(kinds)))]
    form = form * np.interp(x, np.linspace(x[0], x[-1], POINTS), bend(random, 0.25))
    return np.asarray(form / np.max(np.abs(form)))


def power(random: Random, low: float, high: float) -> Form:
    """Return a distorted power of a size on the unit range, with its exponent drawn."""
    exponent, factor = random.uniform(low, high), bend(random)

    def form(x: FloatArray) -> FloatArray:
        return np.asarray(x**exponent * np.interp(x, grid(), factor))

    return form


def bank(random: Random, reach: float) -> tuple[str, FloatArray, FloatArray]:
    """Draw an operator that builds up over a way after each reversal: kind, reaches and weights.

    Stops side by side (Prandtl-Ishlinskii, Maxwell slip) or a loop after Bouc and Wen.
    """
    if random.random() < 0.5:
        shape = np.array([reach, random.uniform(1.0, 3.0), random.uniform(0.5, 1.0)])
        return "bouc_wen", shape, np.ones(1)
    reaches, weights = _in_parallel(random, reach, int(random.integers(3, 12)))
    return "stops", reaches, weights


def relays(random: Random, reach: float) -> tuple[FloatArray, FloatArray]:
    """Draw relays about zero (Preisach): where each switches on, then off, and their weights.

    What they give depends on the place and, within the reach of it, on the way there.
    """
    reaches, weights = _in_parallel(random, reach, BANK)
    middle = reach * random.normal(0.0, 0.6, BANK)
    return np.concatenate([middle + reaches, middle - reaches]), weights


def _in_parallel(random: Random, reach: float, count: int) -> tuple[FloatArray, FloatArray]:
    """Draw reaches and weights of elements that act in parallel."""
    weights = random.gamma(random.uniform(0.6, 2.0), size=count)
    return reach * np.exp(random.uniform(-1.2, 0.4, count)), weights / weights.sum()
