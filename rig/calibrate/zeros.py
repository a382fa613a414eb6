"""Zeros of the sensors in recordings that exist: how far they moved within runs and over all."""

import json
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimation.channels import unit_of
from rig.log.reader import LogFile
from rig.log.recalibrate import ATTACHMENT, ZERO_SUFFIX, carried_calibrations

CONFIG = "config.json"


@dataclass(frozen=True, slots=True)
class ZeroMotion:
    """The zero of one sensor over some runs."""

    channel: str
    unit: str  # the unit of all values, SI
    runs: int  # number of runs with a zero before and after
    within_run: float  # largest change from before a run to after it, as a magnitude
    over_all: float  # range of the zeros before all runs; it was tared off each run
    # largest change within a run that the configuration allows; None for no limit
    limit: float | None

    @property
    def is_wrong(self) -> bool:
        """Whether it moved within a run by more than its limit."""
        return self.limit is not None and self.within_run > self.limit


def zero_motions(logs: Sequence[LogFile]) -> list[ZeroMotion]:
    """Return how far the zero of every sensor moved that was tared before and after runs.

    Of the heads of logs, those without both zeros or without calibrations are left out.
    """
    zeros: dict[str, list[tuple[float, float]]] = defaultdict(list)
    limits: dict[str, float | None] = {}
    for log in logs:
        if log.run is None or log.end is None or log.attached(ATTACHMENT) is None:
            continue
        lines = carried_calibrations(log).channels
        limits |= json.loads(log.attached(CONFIG) or b"{}").get("drift", {})
        for key, before in log.run.zeros_before.items():
            line = lines.get(key.removesuffix(ZERO_SUFFIX))
            after = log.end.zeros_after.get(key)
            if line is not None and after is not None:
                zeros[line.channel].append((before * line.slope, after * line.slope))
    return [_motion(name, np.array(values), limits.get(name)) for name, values in zeros.items()]


def _motion(channel: str, values: np.ndarray, limit: float | None) -> ZeroMotion:
    return ZeroMotion(
        channel,
        unit_of(channel),
        len(values),
        float(np.abs(values[:, 1] - values[:, 0]).max()),
        float(np.ptp(values[:, 0])),
        limit,
    )
