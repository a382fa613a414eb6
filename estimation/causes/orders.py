"""Orders of an angle at which the error of an equation repeats, whole or not.

What turns behind a belt, a gear or a roller repeats so many times per turn of the shaft whose angle
is read as the ratio is, which may be any number. Over many turns there are thousands of such orders
that the data resolve, too many to be candidates: those at which the error is largest are.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy import fft

from estimation.causes.angles import angles_of
from estimation.causes.equations import Equation
from estimation.causes.layout import Layout
from estimation.recording import FloatArray

WAVES = 6
"""Waves that are taken off the error one after another, the largest first."""

TOGETHER = 0.99
"""Share of the variance of an angle that another one of the same gear train has."""

PLACES, FINER, MOST_PLACES = 8, 4, 1 << 22
"""Places in the shortest period, steps in the order that the travel resolves, most places."""


def largest_orders(
    layout: Layout, equation: str, angle: str, factors: Sequence[str], least: float, most: float
) -> tuple[list[float], int]:
    """Return orders that are not whole, of the largest waves, and how many were compared.

    Args:
        layout: The runs.
        equation: Name of the equation whose error is searched, without what it declares.
        angle: Channel that the waves are of.
        factors: Channels that the waves are multiplied by.
        least: Least order.
        most: Largest order.
    """
    turned, left = _on_grid(layout, equation, angle), _error(layout, layout.equations[equation])
    factor = np.ones(len(left))
    for channel in factors:
        factor = factor * _on_grid(layout, equation, channel)
    turned = turned - turned.min()
    reach, step = float(turned.max()), 2.0 * math.pi / (PLACES * most)
    resolved = 2.0 * math.pi / max(reach, step)
    size = fft.next_fast_len(FINER * (int(reach / step) + 2), real=True)
    if 2.0 * resolved > 1.0 or size > MOST_PLACES:
        return [], 0
    places, spacing = np.rint(turned / step).astype(np.intp), 2.0 * math.pi / (size * step)
    first, last = math.ceil(least / spacing), math.floor(most / spacing)
    found = list[float]()
    for _ in range(WAVES):
        waves = fft.rfft(np.bincount(places, left * factor, size))[first : last + 1]
        if not len(waves):
            break
        near = (first + int(np.argmax(np.abs(waves)))) * spacing
        order = _sharpened(turned, left * factor, near, spacing)
        wave = factor[:, None] * np.column_stack([np.sin(order * turned), np.cos(order * turned)])
        left = left - wave @ np.linalg.lstsq(wave, left)[0]
        if all(abs(order - known) > resolved for known in (round(order), *found)):
            found.append(order)
    return found, math.ceil((most - least) / resolved)


def orders_elsewhere(layout: Layout, angle: str, order: float) -> Iterator[tuple[str, float]]:
    """Yield the angles of other shafts that turn with this one, and the order that it is there."""
    for other in angles_of(layout):
        if other != angle and (ratio := _ratio(layout, angle, other)):
            yield other, order / ratio


def _ratio(layout: Layout, angle: str, other: str) -> float:
    """Return how far another shaft turns with this one, no sign; zero where they do not."""
    moved = [
        np.vstack([run.on_grid(name) - run.on_grid(name).mean() for name in (angle, other)])
        for run in layout.runs
    ]
    (own, both), (_, theirs) = sum(m @ m.T for m in moved)
    return abs(both) / own if both**2 > TOGETHER * own * theirs else 0.0


def _sharpened(turned: FloatArray, values: FloatArray, near: float, spacing: float) -> float:
    """Return the order of the largest wave within one step of an order."""
    orders = near + spacing * np.linspace(-1.0, 1.0, 17)
    sums = [abs(np.exp(-1j * order * turned) @ values) for order in orders]
    return float(orders[int(np.argmax(sums))])


def _on_grid(layout: Layout, equation: str, channel: str) -> FloatArray:
    """Return a channel at the samples of all runs that an equation counts."""
    return np.concatenate([run.on_grid(channel)[run.used[equation]] for run in layout.runs])


def _error(layout: Layout, equation: Equation) -> FloatArray:
    """Return the error of the declared terms, each run's mean removed, of all runs."""

    def error() -> FloatArray:
        parts = []
        for run in layout.runs:
            used = run.grid[run.used[equation.name]]
            target = run.channels[equation.target][used, None]
            whole = np.hstack([equation.columns(run.channels)[used], target])
            parts.append(whole - whole.mean(axis=0))
        table = np.vstack(parts)
        table /= np.linalg.norm(table, axis=0) + np.finfo(float).tiny
        return np.asarray(
            table[:, -1] - table[:, :-1] @ np.linalg.lstsq(table[:, :-1], table[:, -1])[0]
        )

    return layout.runs[0].once(("error", equation.name), error)
