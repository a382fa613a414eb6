"""The sample rate that a table probably has, before anyone stated which column is its clock."""

import re

import numpy as np

from estimation.recording import FloatArray
from rig.importers.clock import FASTEST_HZ, SLOWEST_HZ
from rig.importers.table.channels import date_of
from rig.importers.table.raw import Raw

CLOCK = re.compile(
    r"^(t|time|zeit|temps|tiempo|stamp|timestamp|date|clock)(?![a-z])", re.IGNORECASE
)
"""Name of a column that probably holds the time."""

UNITS = {"ns": 1e-9, "us": 1e-6, "µs": 1e-6, "ms": 1e-3, "s": 1.0}
"""Unit of a clock, as its column's name ends in it, to seconds."""

MOST_READ = 1000
"""Samples that are enough for a rate."""


def likely_rate_hz(raw: Raw) -> float | None:
    """Return the sample rate by the first column that can be the clock; None without one.

    Where its name states no unit, it is in the largest one of which the rate is plausible.
    """
    for name in raw.columns:
        if CLOCK.match(name) is None:
            continue
        steps = np.diff(_times(raw, name))
        step = float(np.median(steps)) if steps.size else 0.0
        if not step > 0.0:  # text that is not a date is NaN
            continue
        word = re.search(r"([a-zµ]+)\W*$", raw.units.get(name, name))
        stated = UNITS.get(word[1] if word else "")
        for unit in (stated,) if stated else sorted({*UNITS.values()}, reverse=True):
            if SLOWEST_HZ < 1.0 / (unit * step) < FASTEST_HZ:
                return 1.0 / (unit * step)
    return None


def _times(raw: Raw, name: str) -> FloatArray:
    values = raw.columns[name][:MOST_READ]
    if values.dtype.kind in "fiu":
        return values.astype(np.float64)
    dates = [date_of(str(cell)) for cell in values]
    return np.array([np.nan if one is None else one.timestamp() for one in dates])
