"""Sensor drift: a zero that changes in proportion to time."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


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
