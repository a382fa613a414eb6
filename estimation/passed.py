"""The share of a wave that the low-pass filter of the channels passes.

A target is filtered, and with it what repeats along a turn: the faster the shaft turns, the less is
left of the wave. Its columns follow from an angle, which the filter barely changes, so each is
multiplied by the filter's gain at the frequency that the wave has at that sample.
"""

import math
from typing import Any

import numpy as np

from estimation.filters import LowPass


def passed(order: float, speed: Any, low_pass: LowPass) -> Any:
    """Return the gain that a filter, forwards and backwards, has on a wave.

    Args:
        order: Waves a turn, or rad per metre of a position.
        speed: Of the angle or the position, rad/s or m/s, shape (n,), or a number or a symbol.
        low_pass: The filter.
    """
    relative = np.abs(speed) * (order / (2.0 * math.pi * low_pass.cutoff_hz))
    return 1.0 / (1.0 + relative ** (2 * low_pass.order))
