"""Drift: a zero that walks away in proportion to time."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class Drift(Proportional):
    """A zero that moves at a constant rate, within a run or over the campaign.

    Equation: error = a elapsed. The target's zero, in whatever balance; a regressor's zero shows
    there in proportion.

    Source: the zero drift of strain-gauge amplifiers, in mV/V a minute, OIML R 60 (2017).
    """

    id = "sensor.drift"
    balances: ClassVar = {"motor": 1, "gearbox": 1, "cable": 1, "stretch": 1, "grasp": 1}
    roles: ClassVar = {"elapsed": "time_s"}
    amplitudes = (Parameter("rate", "target / elapsed", "change of the zero in a second"),)
    confused_with = ("sensor.creep", "friction.warmup", "motor.thermal", "change.step")
    told_apart_by = "the unloaded sensor at rest before, during and after a run"
