"""Torque constant: torque in proportion to a motor current or to its command."""

from typing import ClassVar

from estimation.effects.effect import Parameter, Proportional


class TorqueConstant(Proportional):
    """Torque of a brushed DC motor, seen behind its gearhead.

    Equation: torque = K source, the source being the measured current, the commanded one, or any
    other surrogate that is taken to be proportional to torque.

    Source: O'Neill et al. 2018, section II.A (torque analogues A to C).
    """

    id = "motor.torque_constant"
    roles: ClassVar = {"source": "motor_current_a"}
    amplitudes = (Parameter("gain", "target / source", "torque for one unit of the source"),)
    confused_with = ("motor.saturation", "friction.load")
    told_apart_by = "stall at several currents of both signs"
