"""Warm-up friction: friction that changes as the machine warms, over time or measured."""

from typing import ClassVar

import numba
import numpy as np

from estimation.effects.effect import (
    REFERENCE_K,
    Inputs,
    Parameter,
    Pointwise,
    Remembering,
    Row,
    Shape,
)
from estimation.effects.memory import BEGINNING, age, not_settled
from estimation.recording import FloatArray


@numba.njit(cache=True)
def _walk(now: FloatArray, shape: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    for i in range(len(now)):
        past = age(now[i, 1], state) / shape[0]
        rows[i, 0] = np.exp(-past) * np.tanh(now[i, 0] / shape[1])


class Warmup(Remembering):
    """Friction of cold grease that decreases with warming.

    A negative F is friction that grows, such as of a fit that expands.

    Equation: torque = F exp(-t / time) tanh(speed / width), t from the run's first sample. F in
    N m, time in s, width in rad/s.

    Check: let the rig run until it is warm and repeat the first run.

    Source: Bittencourt, Wernholt, Sander-Tavallaey and Brogardh 2010 (friction of a robot joint as
    it warms), to first order in temperature.
    """

    id = "friction.warmup"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "clock": "time_s"}
    amplitudes = (Parameter("friction", "target", "loss at the start minus the final loss"),)
    shape: ClassVar[tuple[Parameter, ...]] = (
        Parameter("time", "clock", "time after which 37 % remains", 0.5, 60.0, points=6),
        Parameter("width", "speed", "speed at which friction reaches 76 %", 1e-2, 50.0, points=6),
    )
    walk = _walk
    rest = BEGINNING
    told_apart_by = "the first run repeated at the end, and again after a night"


class CampaignWarmup(Pointwise):
    """Friction that decreases, or with a negative F grows, over hours of operation.

    Equation: torque = F exp(-t / time) tanh(speed / width), t from the start of the first run. F in
    N m, time in s, width in rad/s.

    Check: repeat the first run at the end of the campaign and after a night.

    Source: Bittencourt, Wernholt, Sander-Tavallaey and Brogardh 2010 (friction of a robot joint as
    it warms), to first order in temperature.
    """

    id = "friction.warmup.campaign"
    meaning = "friction that changes over the hours of a campaign"
    family = "friction.warmup"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "campaign_clock": "campaign_time_s"}
    amplitudes = (Parameter("friction", "target", "loss at the start minus the final loss"),)
    shape: ClassVar[tuple[Parameter, ...]] = (
        Parameter("time", "campaign_clock", "time after which 37 % remains", 30, 2e4, points=6),
        Parameter("width", "speed", "speed at which friction reaches 76 %", 1e-2, 50.0, points=6),
    )
    told_apart_by = "the first run repeated at the end, and again after a night"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (not_settled(inputs, shape[0]) * np.tanh(inputs["speed"] / shape[1]),)


class MeasuredWarmup(Pointwise):
    """Friction that decreases with a measured temperature, or with a negative F grows.

    Equation: torque = F (298.15 K - temperature) tanh(speed / width). F in N m/K, temperature in K,
    width in rad/s.

    Check: compare a cold run with the same run when the machine is warm.

    Source: Bittencourt, Wernholt, Sander-Tavallaey and Brogardh 2010 (friction of a robot joint as
    it warms), to first order in temperature.
    """

    id = "friction.warmup.measured"
    meaning = "friction that changes with a measured temperature"
    family = "friction.warmup"
    balances: ClassVar = {"motor": -1, "cable": 1, "grasp": -1, "joint": 1}
    roles: ClassVar = {"speed": "motor_velocity_rad_s", "temperature": "motor_temperature_k"}
    amplitudes = (Parameter("friction", "target / temperature", "fall of the loss per kelvin"),)
    shape: ClassVar[tuple[Parameter, ...]] = (
        Parameter("width", "speed", "speed at which friction reaches 76 %", 1e-2, 50.0, points=6),
    )
    told_apart_by = "the same run when the machine is cold and when it is warm"

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        colder = REFERENCE_K - inputs["temperature"]
        return (colder * np.tanh(inputs["speed"] / shape[0]),)


class ViscousWarmup(MeasuredWarmup):
    """Viscous friction that decreases with a measured temperature, as the viscosity of grease does.

    Equation: torque = D (298.15 K - temperature) speed. D in N m s/rad/K, temperature in K.

    Check: compare a cold run with the same run when the machine is warm.

    Source: Bittencourt, Wernholt, Sander-Tavallaey and Brogardh 2010 (friction of a robot joint as
    it warms), to first order in temperature.
    """

    id = "friction.warmup.viscous"
    meaning = "viscous friction that changes with a measured temperature"
    amplitudes = (
        Parameter("damping", "target / speed / temperature", "fall of the damping per kelvin"),
    )
    shape = ()

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return ((REFERENCE_K - inputs["temperature"]) * inputs["speed"],)


class ViscousCampaignWarmup(CampaignWarmup):
    """Viscous friction of cold grease or oil that decreases with warming, over a campaign.

    Equation: torque = D exp(-t / time) speed, t from the start of the first run. D in N m s/rad,
    time in s.

    Check: repeat the first run at the end of the campaign and after a night.

    Source: Bittencourt, Wernholt, Sander-Tavallaey and Brogardh 2010 (friction of a robot joint as
    it warms), to first order in temperature.
    """

    id = "friction.warmup.viscous.campaign"
    meaning = "viscous friction that changes over the hours of a campaign"
    amplitudes = (
        Parameter("damping", "target / speed", "damping at the start minus the final damping"),
    )
    shape = CampaignWarmup.shape[:1]

    def row(self, inputs: Inputs, shape: Shape) -> Row:
        """Return one value or one array per amplitude."""
        return (not_settled(inputs, shape[0]) * inputs["speed"],)
