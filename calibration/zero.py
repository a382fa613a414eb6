"""Sensor zeros before and after a run, and whether they drifted in between."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.errors import CalibrationError
from calibration.linear import CalibrationSet
from estimation.channels import unit_of

MINIMUM_SAMPLES = 100


@dataclass(frozen=True, slots=True)
class Drift:
    """How far a zero moved over a run."""

    channel: str
    unit: str
    before: float  # zero before the run relative to the calibration's own, SI
    after: float  # the same after the run, SI
    limit: float  # largest change that passes, SI
    passes: bool  # whether the change is within the limit


def measure_zeros(counts: NDArray[np.void], calibrations: CalibrationSet) -> dict[str, float]:
    """Return the mean of structured raw counts, shape (n,), at rest, of every tared channel.

    Raises:
        CalibrationError: Too few readings, or none of them differ although a real sensor has noise.
    """
    tared = {name: line for name, line in calibrations.channels.items() if line.tared}
    if tared and counts.size < MINIMUM_SAMPLES:
        raise CalibrationError(
            f"{counts.size} readings are too few for a zero.",
            f"A zero is the mean of at least {MINIMUM_SAMPLES} readings at rest.",
        )
    zeros = {}
    for name, line in tared.items():
        readings = counts[line.counts].astype(np.float64)
        if np.ptp(readings) == 0:
            raise CalibrationError(
                f"{name} read {counts.size} times the same: {readings[0]:g} counts.",
                "A real sensor has noise; this one is not connected, or its input is stuck.",
                "Check its plug and its supply.",
            )
        zeros[name] = float(readings.mean())
    return zeros


def drift_verdicts(
    before: Mapping[str, float],
    after: Mapping[str, float],
    calibrations: CalibrationSet,
    limits: Mapping[str, float],
) -> list[Drift]:
    """Compare the zeros before and after a run, counts.

    The limits are the largest changes that pass, SI; a channel without one is not judged.
    """
    verdicts = []
    for name, limit in limits.items():
        if name not in before or name not in after:
            raise CalibrationError(
                f"{name} has a drift limit but no zero.",
                "Only channels that are tared have a zero.",
                "Remove the limit, or set `tared = true` in the calibration.",
            )
        line = calibrations.channels[name]
        first = (before[name] - line.zero_counts) * line.slope
        last = (after[name] - line.zero_counts) * line.slope
        passes = abs(last - first) <= limit
        verdicts.append(Drift(name, unit_of(name), first, last, limit, passes))
    return verdicts
