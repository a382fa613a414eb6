"""A trace drawn in braille: two by four dots a character, so a short line shows much."""

import math

import numpy as np

from estimation.recording import FloatArray

DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
"""Bit of each dot of a braille character, (row, column), Unicode block U+2800."""


def sparkline(
    low: FloatArray, high: FloatArray, width: int, height: int, scale: tuple[float, float]
) -> list[str]:
    """Draw the range of a signal in each stretch of time.

    Args:
        low: Least value in each segment, shape (n,), oldest first; NaN makes a gap.
        high: Greatest value, shape (n,).
        width: Characters across.
        height: Lines down.
        scale: Values at the lower and the upper edge.

    Returns:
        `height` strings of `width` characters.
    """
    edges = np.linspace(0, low.size, 2 * width + 1)
    first = np.minimum(edges[:-1].astype(int), low.size - 1)
    low, high = np.fmin.reduceat(low, first), np.fmax.reduceat(high, first)
    # reach out to the neighbour, so that a steep rise is one line and not two dots
    low, high = (
        np.fmin(low, np.where(np.isnan(low), np.nan, np.append(np.nan, high[:-1]))),
        np.fmax(high, np.where(np.isnan(high), np.nan, np.append(np.nan, low[:-1]))),
    )
    rows = 4 * height
    per_row = (scale[1] - scale[0]) / (rows - 1)
    level = scale[1] - per_row * np.arange(rows)[:, None]
    dots = (level >= low - per_row / 2) & (level <= high + per_row / 2)
    cells = dots.reshape(height, 4, width, 2) * DOTS[None, :, None, :]
    return ["".join(chr(0x2800 + int(c)) for c in row) for row in cells.sum(axis=(1, 3))]


def round_scale(low: float, high: float) -> tuple[float, float]:
    """Return round edges around a range and zero, so that the scale seldom changes.

    Args:
        low: Least value shown.
        high: Greatest value shown.
    """
    low, high = min(low, 0.0), max(high, 0.0)
    if high - low < 1e-9:
        return 0.0, 1.0
    power = 10.0 ** math.floor(math.log10(high - low))
    step = next(power * s for s in (0.2, 0.5, 1.0, 2.0) if power * s * 5 >= high - low)
    return step * math.floor(low / step), step * math.ceil(high / step)
