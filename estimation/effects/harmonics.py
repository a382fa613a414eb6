"""The first three harmonics, for periodic effects that are not a pure sine."""

from typing import Any

import numpy as np

from estimation.effects.effect import Parameter


def harmonics_in(unit: str) -> tuple[Parameter, ...]:
    """Return the amplitudes of the harmonics, in a unit."""
    return tuple(
        Parameter(f"{wave}_{n}", unit, f"amplitude of the {wave} at {n} times the order")
        for n in (1, 2, 3)
        for wave in ("sine", "cosine")
    )


def harmonics(phase: Any) -> list[Any]:
    """Return sine and cosine of each harmonic, in the order of the amplitudes.

    Args:
        phase: Phase of the first one, rad, a value or an array.
    """
    return [wave(n * phase) for n in (1, 2, 3) for wave in (np.sin, np.cos)]
