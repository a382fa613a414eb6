"""Electrical lag: torque or force that lags behind its drive's current or command."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Remembering
from estimation.effects.memory import AT_REST, behind


class ElectricalLag(Remembering):
    """Torque or force that follows a current or command as a first-order lag.

    Eddy currents and the amplifier's current loop delay the flux linked with the rotor against the
    current measured at the supply.

    Equation: torque = K (lagged - current); d lagged / dt = (current - lagged) / T, steady on the
    first sample. K in N m/A, T in s.

    Check: measure torque and current in a fast chirp with a blocked output.

    Source: the first-order RL model of a DC motor's windings; Krishnan 2001, "Electric Motor
    Drives", chapter 2.
    """

    id = "motor.electrical"
    balances: ClassVar = {"motor": 1, "grasp": 1}
    roles: ClassVar = {"clock": "time_s", "current": "motor_current_a"}
    amplitudes = (
        Parameter("gain", "target / current", "torque constant of the lagging part", lower=0.0),
    )
    shape = (Parameter("time_constant", "clock", "time constant of the lag", 5e-4, 5e-2, points=6),)
    walk = behind
    rest = AT_REST
    told_apart_by = "a fast chirp of the current against a blocked output, and in free motion"
