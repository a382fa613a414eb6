"""Torque constant: torque or force proportional to a drive's current or command."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class TorqueConstant(Proportional):
    """Torque of a brushed DC motor, measured after its gearhead.

    Equation: torque = K source. The source is the measured current, the commanded current, or
    another signal that is assumed to be proportional to torque; K in N m per unit of the source.

    Check: measure torque or force at standstill at several currents of both signs.

    Source: O'Neill et al. 2018, section II.A (torque analogues A to C).
    """

    id = "motor.torque_constant"
    roles: ClassVar = {"source": "motor_current_a"}
    amplitudes = (Parameter("gain", "target / source", "torque or force per unit of the source"),)
    told_apart_by = "stall at several currents of both signs"
