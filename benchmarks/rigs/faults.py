"""Hidden faults of sensors: what a faulty one adds to its reading, as data.

They are worked out on what the plant did, after it did it: no fault moves the plant.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from benchmarks.rigs.hidden import Table
from benchmarks.rigs.sensors import lagged
from estimation.recording import FloatArray

KINDS = ("function", "delay", "lag", "creep")


@dataclass(frozen=True, eq=False)
class Fault:
    """One fault of one sensor.

    Attributes:
        reading: Channel of the sensor.
        kind: One of `KINDS`: amplitude x table(source); late by the amplitude, s; behind a lag of
            the amplitude, s; a share of the amplitude that comes slowly.
        source: Channel that the table is over, its own or another one, or `run_time` or
            `campaign_time`.
        table: Of a function.
        times_s: Of creep: its time constants.
        weights: Of creep: the share of each.
    """

    reading: str
    kind: str
    source: str = ""
    table: Table | None = None
    times_s: FloatArray = field(default_factory=lambda: np.empty(0))
    weights: FloatArray = field(default_factory=lambda: np.empty(0))


def error_of(
    fault: Fault, amplitude: float, true: Mapping[str, FloatArray], first: int, start_s: float
) -> FloatArray:
    """Return the values that a fault adds to its reading in one run, shape (n,).

    Args:
        fault: The fault.
        amplitude: Its size, in the reading's unit, s for delay and lag, 1 for creep.
        true: Channel to what there is, shape (n,), from the lead on.
        first: Sample at which the run begins.
        start_s: Campaign time of that sample.
    """
    own = true[fault.reading]
    t: FloatArray = (np.arange(len(own)) - first) / 1000.0
    if fault.kind == "delay":
        return np.asarray(np.interp(t - amplitude, t, own) - own)
    if fault.kind == "lag":
        return lagged(own, amplitude) - own
    if fault.kind == "creep":
        parts = zip(fault.weights, fault.times_s, strict=True)
        slow = sum(w * (lagged(own, float(time)) - own) for w, time in parts)
        return np.asarray(amplitude * slow)
    assert fault.table is not None
    clocks: dict[str, FloatArray] = {"run_time": t, "campaign_time": start_s + t}
    source: FloatArray = clocks[fault.source] if fault.source in clocks else true[fault.source]
    return amplitude * fault.table.at(source)
