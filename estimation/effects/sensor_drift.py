"""Sensor drift: a zero that changes in proportion to time."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import (
    Inputs,
    Parameter,
    Pointwise,
    Proportional,
    Remembering,
    Row,
    Shape,
)
from estimation.effects.memory import BEGINNING, age, not_settled
from estimation.recording import FloatArray


class Drift(Proportional):
    """A zero that changes at a constant rate, within a run or over the campaign.

    Equation: error = a elapsed, elapsed in s, a in the target's unit per s. It is the zero of the
    equation's target; the zero of a regressor appears in proportion.

    Check: read the unloaded sensor at standstill before, during and after a run.

    Source: the zero drift of strain-gauge amplifiers, in mV/V a minute, OIML R 60 (2017).
    """

    id = "sensor.drift"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1, "grasp": 1}
    roles: ClassVar = {"elapsed": "time_s"}
    amplitudes = (Parameter("rate", "target / elapsed", "change of the zero per second"),)
    told_apart_by = "the unloaded sensor at standstill before, during and after a run"


class CampaignDrift(Pointwise):
    """A zero that approaches its warm value by an exponential while a campaign lasts.

    Equation: error = a (1 - exp(-t / T)), t since the campaign's first run began.

    Source: Newton's law of cooling, for a strain gauge heated by its own bridge.
    """

    id = "sensor.drift.campaign"
    meaning = "a zero that settles exponentially over a campaign"
    family = "sensor.drift"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1, "grasp": 1}
    roles: ClassVar = {"campaign_clock": "campaign_time_s"}
    amplitudes = (Parameter("drift", "target", "zero when warm less zero when cold"),)
    shape = (Parameter("time", "campaign_clock", "time until 63 % of it", 30, 2e4, points=6),)
    told_apart_by = "the unloaded sensor at rest before, during and after a campaign"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (1.0 - not_settled(inputs, shape[0]),)


@numba.njit(cache=True)
def _walk_exponential(
    now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray
) -> None:
    for i in range(len(now)):
        rows[i, 0] = 1.0 - np.exp(-age(now[i, 0], state) / shape[0])


class SettlingDrift(Remembering):
    """A zero that approaches its warm value exponentially.

    Equation: error = a (1 - exp(-t / T)), t from the first sample of the run. a in the target's
    unit, T in s.

    Check: let the amplifier warm up and read the unloaded sensor at standstill before and after a
    run.

    Source: Newton's law of cooling, for a strain gauge heated by its own bridge.
    """

    id = "sensor.drift.exponential"
    meaning = "a zero that settles exponentially over a run"
    family = "sensor.drift"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1, "grasp": 1}
    roles: ClassVar = {"clock": "time_s"}
    amplitudes = (Parameter("drift", "target", "warm zero minus cold zero"),)
    shape = (Parameter("time_constant", "clock", "time to reach 63 %", 0.5, 100.0, points=6),)
    walk = _walk_exponential
    rest = BEGINNING
    told_apart_by = "the unloaded sensor at standstill before, during and after a run"


@numba.njit(cache=True)
def _walk_logarithmic(
    now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray
) -> None:
    for i in range(len(now)):
        rows[i, 0] = np.log1p(age(now[i, 0], state) / shape[0])


class LogarithmicDrift(SettlingDrift):
    """A zero that changes by the same amount in each decade of time, as polymers relax.

    Equation: error = a ln(1 + t / T), t from the first sample of the run. a in the target's unit, T
    in s.

    Check: read the unloaded sensor at standstill before, during and after a run.

    Source: drift of piezoresistive force sensors, stated by their makers as % for each decade of
    time; Hall et al. 2008 for force-sensing resistors.
    """

    id = "sensor.drift.logarithmic"
    meaning = "a zero that changes with the logarithm of time"
    amplitudes = (Parameter("drift", "target", "change per factor 2.7 of time"),)
    shape = (Parameter("onset", "clock", "time when the change slows", 0.05, 50.0, points=4),)
    walk = _walk_logarithmic
